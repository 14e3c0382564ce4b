"""Multi-object tracker: positions, velocities and predictions of people from the 3D boxes of an image sequence.

Each person is tracked by a constant-velocity Kalman filter in the plane (`kalman_filter`). Detections are assigned to
tracks by maximum total likelihood (`association`). A detection that a new target explains better starts a track
(`initiate`) that is published once it is likely to be a person (`track`). Undetected people are not dropped
immediately: their tracks stay published for a short time if a camera should detect them, and for longer if a person or
an object occludes them (`occlusion`). Unpublished tracks are kept for longer still, so that people who reappear keep
their track ID.
"""
import math
import operator
from typing import Callable, Dict, Iterable, List, NamedTuple, Optional, Sequence, Set, Tuple

from ros_3d_bb.core.detector_model import DetectorModel
from ros_3d_bb.core.object_classes import ObjectClasses
from ros_3d_bb.core.params import LARGEST, Param, parameters
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.tracking.appearance import Departed, departed_after, meet, returned
from ros_3d_bb.tracking.association import NEW_NS, associate, detection_log_odds_of, duplicates, initiate
from ros_3d_bb.tracking.manoeuvres import match_manoeuvres
from ros_3d_bb.tracking.measurement_model import (BOX_ERRORS, DEFAULT_RANGE_M, BoxNoise, Kinds, Measurement,
                                                  NoiseParams, correlated_images, learned_log_scale, learned_range,
                                                  measurements_of, scaled)
from ros_3d_bb.tracking.occlusion import CameraState, contradicting_cameras, mark_missed
from ros_3d_bb.tracking.out_of_sequence import DetectedImage, Match, OutOfSequenceBuffer
from ros_3d_bb.tracking.prediction import PredictionParams, learned_prediction, published
from ros_3d_bb.tracking.track import MIN_TRACK_SCORE, Rules, Track
from ros_3d_bb.tracking.types import VISIBLE, CameraView, Detection, TrackedObject, check_steps

MAX_POSITION_STD_M = 2.4  # tracks whose position is less certain are dropped; chosen
TENTATIVE_TIMEOUT_S = 0.75  # how long a tentative track is kept without a detection; chosen
BY_ID, FIRST_SEEN, BY_STAMP = (operator.attrgetter(name) for name in ('id', 'first_ns', 'stamp_ns'))
# Sections of the parameters.
MOTION, ASSOCIATION = 'how people move', 'association of boxes with tracks'


@parameters('life of a track')
class TrackerParams(NamedTuple):
    """Parameters of the tracker."""

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
        0.14, 'Density of new targets and false detections. A box that no track explains better than this starts a '
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
        'occluder. People whose clothes are recognised keep their ID. With 0, every missed person gets a new ID.',
        's', live=(0, 30))
    moving_speed: float = Param(
        0.2, 'A person counts as moving from this speed on, and then down to half of it.', 'm/s', live=(0, 1))


class _State(NamedTuple):
    """State of the tracker after an image: the tracks, the stamp of the latest image, the `CameraState` of each camera,
    the learned `measurement_model.learned_log_scale`, the number of boxes whose tracks ended unpublished, and the
    people who may return, `appearance.Departed`.
    """

    tracks: Sequence[Track]
    now_ns: Optional[int]
    cameras: dict
    log_noise_scale: float
    untracked_boxes: int
    departed: tuple = ()


class Tracker(object):
    """Tracks people and other objects from image to image.

    Images of several cameras may arrive late and in any order. Parameters: TrackerParams, NoiseParams and
    PredictionParams. `detector` is a DetectorModel. The IDs of tracks are greater than `last_id`, and tracks never
    change between the groups of `classes`.

    Raises
    ------
    ValueError
        If a parameter is invalid; the message names it.

    Examples
    --------
    A person walks along y at 1 m/s, 4 m in front of a camera at the origin that looks along x:

    >>> import numpy as np
    >>> from ros_3d_bb.tracking.types import CameraView, Detection
    >>> view = CameraView(np.array([[0, 0, 1, 0], [-1, 0, 0, 0], [0, -1, 0, 1], [0, 0, 0, 1]], float))
    >>> tracker = Tracker()
    >>> for image in range(31):
    ...     person = Detection(position_m=(4, image / 30, 0.9), size_m=(0.5, 0.5, 1.8), score=0.9)
    ...     tracks = tracker.update(stamp_ns=image * NS // 30, detections=[person], view=view)
    >>> [(track.id, track.position_m.round(1).tolist(), track.velocity_mps.round(1).tolist()) for track in tracks]
    [(1, [4.0, 1.0, 0.9], [0.0, 1.0, 0.0])]
    >>> tracks[0].prediction_m[-1].round(1).tolist()  # after 2 s
    [4.0, 2.9, 0.9]
    """

    def __init__(self, params: TrackerParams = TrackerParams(), noise: NoiseParams = NoiseParams(),
                 prediction: PredictionParams = PredictionParams(), last_id: int = 0,
                 classes: ObjectClasses = ObjectClasses(), detector: DetectorModel = DetectorModel()) -> None:
        self._kinds, self._detector = Kinds(classes), detector
        self._start(last_id)
        self.reconfigure(params, noise, prediction)

    def _start(self, last_id: int, log_noise_scale: float = 0.0) -> None:
        state = _State([], None, {}, log_noise_scale, 0)
        self._buffer = OutOfSequenceBuffer(self._step, state, last_id)

    def reconfigure(self, params: TrackerParams, noise: NoiseParams, prediction: PredictionParams) -> None:
        """Change the parameters and keep the tracks. Raises ValueError without any change if one is invalid."""
        check_steps(prediction.prediction_time, prediction.prediction_step)
        self._params = params, noise, prediction
        self._rules = Rules.of(params, self._kinds)

    def delete_at(self, is_ignored: Callable[[Tuple[float, float]], bool]) -> None:
        """Delete the tracks for whose position (x, y) `is_ignored` returns True."""
        self._buffer.replay()
        state = self._buffer.state
        tracks = [track for track in state.tracks if not is_ignored((track.state.x, track.state.y))]
        self._buffer = OutOfSequenceBuffer(self._step, state._replace(tracks=tracks), self._buffer.last_id)

    def reset(self) -> None:
        """Delete all tracks, as after a jump in time. IDs are not reused, and the learned noise is kept."""
        self._start(self._buffer.last_id, self._buffer.state.log_noise_scale)

    def skip(self, stamp_ns: int, camera: str = '') -> None:
        """Skip an image whose detections are unusable: tracks do not age. Never raises, as the image may be late."""
        self._buffer.skip(stamp_ns, camera)

    def update(self, stamp_ns: int, detections: Iterable[Detection], view: CameraView) -> List[TrackedObject]:
        """Update the tracks with a list of Detection in the image of a CameraView. Returns the tracks as a list of
        TrackedObject, ordered by ID, at the stamp of the newest image.

        The result may not include the detections of images that are several images late yet (`out_of_sequence`).
        Raises ValueError if the image is too late or a duplicate; the tracks are unchanged.
        """
        self._buffer.insert(DetectedImage(stamp_ns, tuple(detections), view))
        return self._published()

    @property
    def untracked_boxes(self) -> int:
        """Number of boxes whose tracks ended unpublished, until the newest image, since the last reset."""
        return self._buffer.state.untracked_boxes

    @property
    def contradicting_cameras(self) -> Optional[Tuple[str, str]]:
        """As of `occlusion.contradicting_cameras`."""
        return contradicting_cameras(self._buffer.state.tracks, self._buffer.state.now_ns)

    def tracks(self) -> List[TrackedObject]:
        """The published tracks as TrackedObject, ordered by ID, at the stamp of the newest image; with all images."""
        self._buffer.replay()
        return self._published()

    def _published(self) -> List[TrackedObject]:
        state, (params, noise, prediction) = self._buffer.state, self._params
        largest_m2 = params.max_position_std ** 2
        tracks = [track for track in sorted(state.tracks, key=BY_ID) if track.is_confirmed and (
            track.status == VISIBLE or track.log_odds >= MIN_TRACK_SCORE and track.state.position_m2 < largest_m2)]
        prediction = learned_prediction(state.log_noise_scale, noise.noise_unknown, prediction)
        newest = max(state.cameras.values(), key=BY_STAMP, default=None)
        camera_m = newest.view.fixed_from_camera[:2, 3] if newest else (0, 0)
        return published(tracks, prediction, params.moving_speed, camera_m)

    def _step(self, before: _State, image: DetectedImage, observed_s: float,
              assign_id: Callable[[int], int]) -> Tuple[_State, List[Match]]:
        """One cycle of the tracker: see `step` of OutOfSequenceBuffer."""
        latest = before.cameras.get(image.view.camera)
        period_s = (image.stamp_ns - latest.stamp_ns) / NS if latest else None
        tracks = self._predict(before, image.stamp_ns)
        measurements = self._measure(before, image, period_s)
        log_odds = detection_log_odds_of(tracks, image.view.camera, period_s, self._detector.detection_probability)
        matches = associate(tracks, measurements, log_odds, self._params[0], self._rules.outliers)
        if len(matches) < len(measurements) and latest:
            matches += match_manoeuvres(tracks, measurements, matches, latest.stamp_ns, image.stamp_ns,
                                        self._params[0].height_sigma)
        matched = {track.id: (track.is_confirmed, measurement.number) for track, measurement in matches}
        log_noise_scale = learned_log_scale(before.log_noise_scale, matches)
        self._update_matched(matches, log_noise_scale - max(before.log_noise_scale, 0), image)
        cameras = self._cameras_after(before, image, matches)
        missed = [track for track in tracks if track.id not in matched]
        mark_missed(missed, tracks, before.tracks, cameras, image.view.camera, observed_s,
                    self._detector.detection_probability)
        tracks, deleted = self._delete(tracks, image.stamp_ns)
        departed = departed_after(before.departed, deleted, image.stamp_ns) if self._params[0].max_age else ()
        detected = [track for track, _measurement in matches]
        meet(detected)
        tracks, departed = _recognised(detected, tracks, departed)
        taken = set(number for _is_confirmed, number in matched.values())
        unmatched = [measurement for measurement in measurements if measurement.number not in taken]
        tracks += initiate(tracks, unmatched, image, period_s, self._params[0], self._rules, assign_id)
        untracked_boxes = before.untracked_boxes + sum(track.hits for track in deleted if not track.is_confirmed)
        state = _State(tracks, image.stamp_ns, cameras, log_noise_scale, untracked_boxes, departed)
        return state, [(track_id,) + match for track_id, match in matched.items()]

    def _predict(self, before: _State, stamp_ns: int) -> List[Track]:
        """Copies of the tracks, predicted to the image; the next steps change them."""
        elapsed_s = 0.0 if before.now_ns is None else (stamp_ns - before.now_ns) / NS
        return [track.predicted(elapsed_s, self._params[0].acceleration) for track in before.tracks]

    def _measure(self, before: _State, image: DetectedImage, period_s: Optional[float]) -> List[Measurement]:
        """The measurements of the image, with the noise for the association: a learned scale that is too small must not
        separate people from their tracks."""
        params, noise, _prediction = self._params
        images = correlated_images(period_s, self._detector, params.acceleration)
        box_noise = BoxNoise(noise.noise_unknown, math.exp(max(before.log_noise_scale, 0)),
                             self._detector.lasting_sigma_m, images)
        return measurements_of(image.detections, image.view, box_noise, self._kinds)

    def _update_matched(self, matches: Iterable[Tuple[Track, Measurement]], log_factor: float,
                        image: DetectedImage) -> None:
        """Update the tracks of the matches, with the variance of assumed noise multiplied by exp(`log_factor`)."""
        scale = math.exp(log_factor)
        for track, measurement in matches:
            track.update(scaled(measurement, scale), image.stamp_ns, image.view.camera, self._rules)

    def _cameras_after(self, before: _State, image: DetectedImage,
                       matches: Sequence[Tuple[Track, Measurement]]) -> Dict[str, CameraState]:
        """The CameraState of each camera after an image with matches."""
        latest, range_m = before.cameras.get(image.view.camera), self._detector.max_range_m
        if range_m is None:
            range_m = learned_range(latest.range_m if latest else DEFAULT_RANGE_M, matches)
        return dict(before.cameras, **{image.view.camera: CameraState(image.stamp_ns, image.view, range_m)})

    def _delete(self, tracks: Sequence[Track], stamp_ns: int) -> Tuple[List[Track], List[Track]]:
        """The tracks that are kept (tentative ones for a short time only), and the tracks that end."""
        max_age_s, kept, deleted = self._params[0].max_age, [], []  # type: float, List[Track], List[Track]
        duplicate_ids: Set[int] = set()
        if tracks and stamp_ns - max(tracks, key=FIRST_SEEN).first_ns < NEW_NS:
            duplicate_ids = duplicates(tracks, stamp_ns)
        for track in tracks:
            limit_s = max_age_s if track.is_confirmed else TENTATIVE_TIMEOUT_S
            is_recent = not track.unseen_s or track.unseen_s < limit_s
            is_kept = is_recent and track.state.position_m2 < MAX_POSITION_STD_M ** 2 and track.id not in duplicate_ids
            (kept if is_kept else deleted).append(track)
        return kept, deleted


def _recognised(detected: Iterable[Track], tracks: List[Track],
                departed: Tuple[Departed, ...]) -> Tuple[List[Track], Tuple[Departed, ...]]:
    """Give new tracks of the detected ones the IDs of people who have returned. Returns the tracks without the former
    tracks of these people, and the departed without them."""
    for track in detected:
        if not (track.is_confirmed and track.appearance is not None and track.appearance.is_new):
            continue
        person = returned(track, [other for other in tracks if other.is_confirmed and other is not track], departed)
        if person is not None:
            track.id, track.first_ns, track.appearance = person.id, person.first_ns, person.appearance
            track.met = track.met | person.met
            tracks = [other for other in tracks if other is track or other.id != person.id]
            departed = tuple(other for other in departed if other.id != person.id)
    return tracks, departed
