"""Track continuity in a simulated scene: track IDs, images without a track, velocity and prediction errors.

Here a person is scored if the body axis is in the image. `clear_mot` scores people of whose body an image shows a
minimum share. A person directly in front of the camera fills the image and shows less than that, but is the most
important one for a robot.
"""
from typing import NamedTuple, Optional

import numpy as np

from ros_3d_bb.camera.camera_model import transform_points
from ros_3d_bb.tracking.association import plane_distances
from ros_3d_bb.tracking.types import VISIBLE
from ros_3d_bb_lab.evaluation.clear_mot import ClearMatcher
from ros_3d_bb_lab.evaluation.scenes import LEAST_SHOWN

NEAREST_M = 0.5  # minimum distance from the camera in the plane
HELD_M = 0.5  # maximum distance between a person and a matching track
HORIZON_S = 1.0  # evaluated prediction horizon
ROUNDING_M = 1e-6


class TrackScore(NamedTuple):
    """Track continuity in a scene.

    `track_ids` is the number of distinct IDs of VISIBLE tracks near people. `not_visible` is the number of images,
    summed over people, in which a person has no VISIBLE track after the first match. `velocity_rmse_mps` and
    `prediction_1s_m` are RMS errors in the plane of the velocity and of the position predicted for `HORIZON_S`; None if
    no track was matched.
    """

    track_ids: int
    not_visible: int
    velocity_rmse_mps: Optional[float]
    prediction_1s_m: Optional[float]


def is_in_image(person, map_from_camera, camera):
    """Whether the body axis of a person is between the left and right image borders, and the body is not mostly
    occluded.

    `person` is a `simulator.PersonTruth`.
    """
    x_m, _y, z_m = transform_points(np.linalg.inv(map_from_camera), person.position_m)
    if person.box_px is None or person.hidden > 1 - LEAST_SHOWN or z_m <= 0:
        return False
    return bool(0 <= camera.fx * x_m / z_m + camera.cx < camera.width)


def score_tracks(steps, camera):
    """Compare the VISIBLE tracks of a scene with the people in the image at `NEAREST_M` or more from the camera.

    Parameters
    ----------
    steps : list of scenes.Step
        Ordered by stamp.
    camera : camera_model.Camera

    Returns
    -------
    TrackScore
    """
    track_ids, not_visible, velocity_errors, prediction_errors = set(), 0, [], []
    followed, matcher = set(), ClearMatcher(HELD_M)
    for step in steps:
        people = _people(step, camera)
        tracks = [track for track in step.moment.tracks if track.status == VISIBLE]
        near_m = plane_distances([person.position_m for person in people] or np.zeros((0, 3)),
                                 [track.position_m for track in tracks] or np.zeros((0, 3))) <= HELD_M
        track_ids.update(track.id for track, near in zip(tracks, near_m.T) if near.any())
        not_visible += sum(person.id in followed and not near.any() for person, near in zip(people, near_m))
        for pair in matcher.match(people, tracks):
            followed.add(pair.person)
            person, track = _with_id(people, pair.person), _with_id(tracks, pair.track)
            velocity_errors.append(_distance(track.velocity_mps, person.velocity_mps))
            prediction_errors += _prediction_errors(track, person)
    return TrackScore(len(track_ids), not_visible, _rms(velocity_errors), _rms(prediction_errors))


def _people(step, camera):
    """Ground-truth tracks of the people of an image that are scored."""
    map_from_camera = step.frame.poses.map_from_camera
    shown = set(person.id for person in step.frame.people if is_in_image(person, map_from_camera, camera)
                and _distance(person.position_m, map_from_camera[:3, 3]) >= NEAREST_M - ROUNDING_M)
    return [person for person in step.moment.truth if person.id in shown]


def _prediction_errors(track, person):
    """Error of the position predicted for `HORIZON_S`, as a list; empty if the prediction is shorter."""
    predicted_m, true_m = (_position_after(item, HORIZON_S) for item in (track, person))
    return [_distance(predicted_m, true_m)] if predicted_m is not None and true_m is not None else []


def _position_after(track, time_s):
    """Predicted position (3,) of a track after `time_s`; None if the prediction is shorter."""
    number = int(round(time_s / track.prediction_step_s)) - 1 if len(track.prediction_m) else 0
    return track.prediction_m[number] if number < len(track.prediction_m) else None


def _with_id(objects, wanted):
    return next(item for item in objects if item.id == wanted)


def _distance(one, other):
    """Distance of two vectors (2,) or (3,) in the plane."""
    return float(np.hypot(*(np.asarray(one) - other)[:2]))


def _rms(errors):
    return float(np.sqrt(np.mean(np.square(errors)))) if errors else None
