"""Multi-object tracker: positions, velocities and predictions of people from the 3D boxes of an image sequence.

Each person is tracked by a constant-velocity Kalman filter in the plane (`kalman_filter`). Detections are assigned to
tracks by maximum total likelihood (`association`). A detection that a new target explains better starts a track, which
is published once it is likely to be a person (`track_score`). If most people seem to jump in the same way, the pose of
the camera jumped, and all tracks are moved (`common_motion`). Undetected people are not dropped immediately: their
tracks stay published for a short time if a camera should detect them, and for longer if a person or an object occludes
them (`occlusion`). Unpublished tracks are kept for longer still, so that people who reappear keep their track ID.
"""
from typing import NamedTuple, Optional

import numpy as np

from ros_3d_bb.core.detector_model import DetectorModel
from ros_3d_bb.core.object_classes import ObjectClasses
from ros_3d_bb.core.params import LARGEST, Param, parameters
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.tracking import kalman_filter, noise_scale, track_score
from ros_3d_bb.tracking.association import associate, unmatched
from ros_3d_bb.tracking.class_numbers import ClassNumbers
from ros_3d_bb.tracking.common_motion import SETTLED_NS, common_motion, may_jump, most_fit, move
from ros_3d_bb.tracking.measurement_model import BOX_ERRORS, NoiseParams, measurements_of
from ros_3d_bb.tracking.occlusion import (DEFAULT_RANGE_M, SEEN, CameraVisibility, learned_range, mark_missed,
                                          recent_others)
from ros_3d_bb.tracking.out_of_sequence import DetectedImage, OutOfSequenceBuffer
from ros_3d_bb.tracking.track import (TRACK, PredictionParams, duplicates, new_targets, objects_of, position_std_of,
                                      update_matched)
from ros_3d_bb.tracking.types import MOVING_SPEED, NOT_DETECTED, OUT_OF_VIEW, VISIBLE, check_steps

KNOWN_NS = 60 * NS  # a camera without images for longer than this, while others send images, counts as new
MAX_POSITION_STD_M = 2.4  # tracks whose position is less certain are dropped
TENTATIVE_TIMEOUT_S = 0.6  # how long a tentative track is kept without a detection
# Sections of the parameters.
MOTION, ASSOCIATION = 'kalman: how people move', 'kalman: association of boxes with tracks'


@parameters('kalman: life of a track')
class TrackerParams(NamedTuple):
    """Parameters of the Kalman tracker."""

    acceleration: float = Param(
        0.08, 'How much the velocity of a walking person varies: density of a white acceleration. With 0, people who '
        'turn get a new ID.', 'm^2/s^3', live=(0.01, 2), section=MOTION)
    initial_speed: float = Param(
        0.8, 'Speed of a new target: standard deviation along each axis.', 'm/s', live=(0, 3), section=MOTION)
    outlier_share: float = Param(
        0.1, 'Share of boxes whose depth is partly that of the background.', limits=(0, 0.999), live=(0, 0.9),
        section=BOX_ERRORS)
    outlier_offset: float = Param(
        0.45, 'How far behind the person their depth is: mean.', 'm', live=(0, 2), section=BOX_ERRORS)
    outlier_spread: float = Param(
        0.3, 'How far behind the person their depth is: standard deviation.', 'm', live=(0, 2), section=BOX_ERRORS)
    new_target_density: float = Param(
        0.12, 'Density of new targets and false detections. A box that no track explains better than this starts a '
        'new track.', '1/m^2', limits=(1e-9, LARGEST), live=(0.001, 1), section=ASSOCIATION)
    duplicate_distance: float = Param(
        0.35, 'No track starts closer than this to a recently matched one.', 'm', live=(0, 1), section=ASSOCIATION)
    height_sigma: float = Param(
        0.085, 'Standard deviation of the difference between the heights of a box and of the track of its person.',
        'm', limits=(1e-6, LARGEST), live=(0.02, 0.5), section=ASSOCIATION)
    confirmation_probability: float = Param(
        0.92, 'A track is published as soon as it is an object with this probability, by the scores of its boxes and '
        'the time for which they fit.', limits=(0.5, 0.98), live=(0.5, 0.98))
    even_score: float = Param(
        0.27, 'Score of the detector at which half of the boxes show an object. Boxes with lower scores continue a '
        'track, but seldom start one. Boxes without a score count as if it were 0.5: they start none if this is 0.6 or '
        'more.', limits=(0.01, 0.99), live=(0.05, 0.95))
    max_position_std: float = Param(
        0.5, 'An undetected track stays published up to this standard deviation of its position.', 'm', live=(0, 2))
    max_age: float = Param(
        4.0, 'A person who is not detected for longer than this gets a new track ID. So does one who reappears where a '
        'new target is more likely: with the default parameters after 3 s, except for people who stop behind an '
        'occluder. With 0, every missed person gets a new ID.', 's', live=(0, 30))
    moving_speed: float = MOVING_SPEED


class _State(NamedTuple):
    """State of the tracker after an image: the tracks, the stamp of the latest image, the `CameraVisibility` of the
    latest image of each camera, the number of images with a common motion, the stamp of the latest image that most
    people did not fit (None without), and the learned `noise_scale`.
    """

    tracks: np.ndarray
    now_ns: int
    cameras: dict
    common_motions: int
    misfit_ns: Optional[int]
    log_noise_scale: float


class Tracker(object):
    """Tracks people and other objects from image to image.

    Call `update` with the detections of each image, `skip` for an image whose detections are unusable, and `reset`
    after a jump in time. Images of several cameras may arrive late and in any order. The IDs of tracks are greater than
    `last_id`. `classes` is the table of the classes of objects: tracks never change between its groups. `detector` is
    a DetectorModel.

    Raises
    ------
    ValueError
        If a parameter is invalid; the message names it.
    """

    def __init__(self, params=TrackerParams(), noise=NoiseParams(), prediction=PredictionParams(), last_id=0,
                 classes=ObjectClasses(), detector=DetectorModel()):
        self._classes, self._detector = ClassNumbers(classes), detector
        self.reconfigure(params, noise, prediction)
        self._start(last_id)

    def _start(self, last_id, log_noise_scale=0.0):
        state = _State(np.zeros(0, TRACK), None, {}, 0, None, log_noise_scale)
        self._buffer = OutOfSequenceBuffer(self._step, state, last_id)

    def reconfigure(self, params, noise, prediction):
        """Change the parameters and keep the tracks. Raises ValueError without any change if one is invalid."""
        check_steps(prediction.prediction_time, prediction.prediction_step)
        self._params, self._noise, self._prediction = params, noise, prediction

    def reset(self):
        """Delete all tracks, as after a jump in time. IDs are not reused, and the learned noise is kept."""
        self._start(self._buffer.last_id, self._buffer.state.log_noise_scale)

    def skip(self, stamp_ns, camera=''):
        """Skip an image whose detections are unusable: tracks do not age. Never raises, as the image may be late."""
        self._buffer.skip(stamp_ns, camera)

    def update(self, stamp_ns, detections, view):
        """Update the tracks with the detections of one image.

        Parameters
        ----------
        stamp_ns : int
            Stamp of the image, nanoseconds.
        detections : list of Detection
        view : CameraView

        Returns
        -------
        list of TrackedObject
            Ordered by ID, at the stamp of the newest image. They may not include the detections of images that are
            several images late yet (`out_of_sequence`).

        Raises
        ------
        ValueError
            If the image is too late or a duplicate; the tracks are unchanged.
        """
        self._buffer.insert(DetectedImage(stamp_ns, tuple(detections), view))
        return self._published()

    @property
    def common_motions(self):
        """Number of images in which the pose of the camera jumped (`common_motion`), since the last reset."""
        return self._buffer.state.common_motions

    def objects(self):
        """The published tracks as TrackedObject, ordered by ID, at the stamp of the newest image; with all images."""
        self._buffer.replay()
        return self._published()

    def _published(self):
        state, params = self._buffer.state, self._params
        tracks = state.tracks.take(np.argsort(state.tracks['id']))
        published = tracks['log_odds'] >= track_score.MIN_TRACK_SCORE
        published &= position_std_of(tracks) < params.max_position_std
        published |= tracks['status'] == VISIBLE
        prediction = noise_scale.learned_prediction(state.log_noise_scale, self._noise.noise_unknown, self._prediction)
        return objects_of(tracks.compress(tracks['confirmed'] & published), prediction, self._classes)

    def _step(self, state, image, observed_s, assign_id):
        """One cycle of the tracker: see `step` of OutOfSequenceBuffer."""
        stamp_ns, detections, view = image
        params, classes, detector, camera = self._params, self._classes, self._detector, view.camera
        tracks = state.tracks.copy()
        elapsed_s = 0.0 if state.now_ns is None else (stamp_ns - state.now_ns) / NS
        density = params.acceleration * classes.acceleration[tracks['class_number']]
        tracks['mean'], tracks['covariance'] = kalman_filter.predict(tracks['mean'], tracks['covariance'], elapsed_s,
                                                                     density)
        tracks['detection'] = NOT_DETECTED

        latest = state.cameras.get(camera)
        period_s = (stamp_ns - latest.stamp_ns) / NS if latest else 0.0
        measurements = measurements_of(detections, view, period_s, self._noise, classes, detector)
        noise_scale.widen(state.log_noise_scale, measurements)
        rows, columns = associate(tracks, measurements, stamp_ns, params, classes)
        known = tracks['confirmed'] & (latest.visibility == SEEN if latest else False)
        fits, motion = most_fit(tracks, known, measurements, rows, columns), None
        is_settled = state.misfit_ns is None or stamp_ns - state.misfit_ns > SETTLED_NS
        if fits is False and is_settled and may_jump(latest, recent_others(state.cameras, camera, stamp_ns)):
            motion = common_motion(tracks, known, measurements, view, classes, period_s)
        misfit_ns = stamp_ns if fits is False else state.misfit_ns
        if fits is None and latest:
            fits = latest.fits
        if motion is not None:
            move(tracks, *motion, view)
            rows, columns = associate(tracks, measurements, stamp_ns, params, classes)
        matches = list(zip(tracks['id'][rows].tolist(), tracks['confirmed'][rows].tolist(), columns.tolist()))
        matched = measurements.take(columns)
        log_noise_scale = noise_scale.learn(state.log_noise_scale, tracks, rows, matched)
        update_matched(tracks, rows, matched, stamp_ns, params, classes)

        range_m = detector.max_range_m
        if range_m is None:
            range_m = learned_range(latest.range_m if latest else DEFAULT_RANGE_M, matched['distance_m'],
                                    tracks['confirmed'], rows)
        cameras = {name: latest for name, latest in state.cameras.items() if stamp_ns - latest.stamp_ns <= KNOWN_NS}
        cameras[camera] = CameraVisibility(stamp_ns, view, np.full(len(tracks), SEEN), range_m, fits)
        missed = unmatched(len(tracks), rows)
        if len(missed):
            mark_missed(tracks, state.tracks, missed, cameras, camera, observed_s, detector.detection_probability)

        # Tentative tracks are kept for a short time only.
        max_unseen_s = np.where(tracks['confirmed'], params.max_age, TENTATIVE_TIMEOUT_S)
        kept = (tracks['unseen_s'] == 0) | (tracks['unseen_s'] < max_unseen_s)
        kept &= position_std_of(tracks) < MAX_POSITION_STD_M
        kept &= ~duplicates(tracks, stamp_ns, classes)
        tracks, unmatched_columns = tracks.compress(kept), unmatched(len(detections), columns)
        new = tracks[:0]
        if len(unmatched_columns):
            new, started = new_targets(tracks, measurements[unmatched_columns], stamp_ns, params, classes)
            new['id'] = [assign_id(column) for column in unmatched_columns[started].tolist()]
            tracks = np.concatenate((tracks, new))
        if len(new) or not kept.all():
            for name, seen in cameras.items():
                added = np.full(len(new), SEEN if name == camera else OUT_OF_VIEW)
                cameras[name] = seen._replace(visibility=np.concatenate((seen.visibility[kept], added)))
        return _State(tracks, stamp_ns, cameras, state.common_motions + (motion is not None), misfit_ns,
                      log_noise_scale), matches
