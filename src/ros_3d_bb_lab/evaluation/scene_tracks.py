"""How well the tracks of a simulated scene hold: track IDs, images without a track, velocity and prediction.

`identities` scores people of whom an image shows a quarter of the body or more. Of a person right before the camera it
shows less, and that is where a robot needs the track most: here a person counts whose middle is in the image.
"""
from typing import NamedTuple, Optional

import numpy as np

from ros_3d_bb.camera.camera_model import transform_points
from ros_3d_bb.tracking.association import plane_distances
from ros_3d_bb.tracking.types import VISIBLE
from ros_3d_bb_lab.evaluation.clear_mot import ClearMatcher
from ros_3d_bb_lab.evaluation.scenes import LEAST_SHOWN

NEAREST_M = 0.5  # distance from the camera in the plane
HELD_M = 0.5  # a track farther from a person is not of that person
HORIZON_S = 1.0  # of the prediction
ROUNDING_M = 1e-6


class TrackScore(NamedTuple):
    """How well the tracks of a scene hold.

    `track_ids` is the number of different IDs of VISIBLE tracks of people. `not_visible` counts, person by person, the
    images after the first one with a VISIBLE track in which there is none. `velocity_rmse_mps` and `prediction_1s_m`
    are RMS errors in the plane, of the velocity and of the position after `HORIZON_S`; None without any track of a
    person.
    """

    track_ids: int
    not_visible: int
    velocity_rmse_mps: Optional[float]
    prediction_1s_m: Optional[float]


def is_in_image(person, map_from_camera, camera):
    """Whether the axis of a person (`simulator.PersonTruth`) is between the left and the right border of the image
    and others hide little of what the image shows.
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
        In the order of their stamps.
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
    """The people of an image who count, as tracks of the truth."""
    map_from_camera = step.frame.poses.map_from_camera
    shown = set(person.id for person in step.frame.people if is_in_image(person, map_from_camera, camera)
                and _distance(person.position_m, map_from_camera[:3, 3]) >= NEAREST_M - ROUNDING_M)
    return [person for person in step.moment.truth if person.id in shown]


def _prediction_errors(track, person):
    """The error of the position after `HORIZON_S`, a list; empty where the tracker predicts less."""
    predicted_m, true_m = (_position_after(item, HORIZON_S) for item in (track, person))
    return [_distance(predicted_m, true_m)] if predicted_m is not None and true_m is not None else []


def _position_after(track, time_s):
    """The predicted position (3,) of a track; None where it predicts less."""
    number = int(round(time_s / track.prediction_step_s)) - 1 if len(track.prediction_m) else 0
    return track.prediction_m[number] if number < len(track.prediction_m) else None


def _with_id(objects, wanted):
    return next(item for item in objects if item.id == wanted)


def _distance(one, other):
    """The distance of two vectors (2 or 3,) in the plane."""
    return float(np.hypot(*(np.asarray(one) - other)[:2]))


def _rms(errors):
    return float(np.sqrt(np.mean(np.square(errors)))) if errors else None
