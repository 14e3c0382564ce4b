"""The multi-object tracker: positions, velocities and predictions of people from the boxes of image after image.

Each person is tracked by a constant-velocity Kalman filter in the plane (`kalman`). Detections are assigned to tracks
by the sum of their likelihoods (`association`); a detection that a new target explains better starts a track, which is
published once it was detected often enough (`track`). Undetected people are not dropped immediately: their tracks are
published for a moment where the camera should have detected them, for longer where a person or an object hides them
(`visibility`, `unseen`), and kept for longer still, so that they get their ID back.
"""
from typing import NamedTuple

import numpy as np

from ros_3d_bb.stamped import NS
from ros_3d_bb.tracking import kalman
from ros_3d_bb.tracking.association import associate, remaining
from ros_3d_bb.tracking.measuring import NoiseParams, sightings_of
from ros_3d_bb.tracking.out_of_sequence import Image, Matches, OutOfSequenceBuffer
from ros_3d_bb.tracking.prediction import PredictionParams, objects_of
from ros_3d_bb.tracking.track import TRACK, new_targets, update_matched
from ros_3d_bb.tracking.tracked import OUT_OF_VIEW, VISIBLE, check_steps
from ros_3d_bb.tracking.unseen import SEEN, Look, carried, miss, others_of, sigma_of

KNOWN_NS = 60 * NS  # a camera that sent nothing for longer, while others did, is a new one
MAX_POSITION_STD_M = 2.4  # tracks whose position is less certain are dropped
TENTATIVE_TIMEOUT_S = 0.6  # how long a track that is not confirmed yet is kept without a detection


class TrackerParams(NamedTuple):
    """See config/tracker.yaml."""

    acceleration: float = 0.08
    initial_speed: float = 0.8
    outlier_share: float = 0.1
    outlier_offset: float = 0.45
    outlier_spread: float = 0.3
    newcomer_density: float = 0.12
    duplicate_distance: float = 0.35
    height_sigma: float = 0.06
    min_sightings: int = 4
    min_age: float = 0.1
    missed_limit: float = 0.35
    out_of_view_limit: float = 1.0
    unsure_limit: float = 0.5
    memory: float = 4.0
    max_range: float = 8.0
    moving_speed: float = 0.2


class _State(NamedTuple):
    """What images change: the tracks and the stamp of the latest image; by camera, the stamp of its latest image and
    its `unseen.Look`.
    """

    tracks: np.ndarray
    now_ns: int
    stamps_ns: dict
    looks: dict


class Tracker(object):
    """Tracks people from image to image.

    Call `update` with the detections of each image, `skip` for an image whose detections could not be used, `reset`
    where time jumped. Images of several cameras may come in any order, and late.

    Raises
    ------
    ValueError
        If a parameter makes no sense; names it.
    """

    def __init__(self, params=TrackerParams(), noise=NoiseParams(), prediction=PredictionParams()):
        self.tune(params, noise, prediction)
        self._buffer = OutOfSequenceBuffer(self._step, _State(np.zeros(0, TRACK), None, {}, {}))

    def tune(self, params, noise, prediction):
        """Go on with other parameters and the same tracks. Raises ValueError as at the start, and changes nothing."""
        for kind in (params, noise, prediction):
            _check(kind)
        check_steps(prediction.prediction_time, prediction.prediction_step)
        self._params, self._noise, self._prediction = params, noise, prediction
        self._outliers = kalman.Outliers(params.outlier_share, params.outlier_offset, params.outlier_spread)

    def reset(self):
        """Forget all tracks, as after a jump in time. IDs are not used again."""
        self._buffer = OutOfSequenceBuffer(self._step, _State(np.zeros(0, TRACK), None, {}, {}), self._buffer.last_id)

    def skip(self, stamp_ns, camera=''):
        """Let an image pass whose detections could not be used: tracks do not age. Never an error: it may be late."""
        self._buffer.skip(stamp_ns, camera)

    def update(self, stamp_ns, detections, view):
        """Take the detections of one image.

        Parameters
        ----------
        stamp_ns : int
            Stamp of the image.
        detections : list of Detection
        view : View

        Returns
        -------
        list of TrackedObject
            By ID, at the stamp of the newest image.

        Raises
        ------
        ValueError
            If the image comes too late, or a second time; nothing changes then.
        """
        self._buffer.insert(Image(stamp_ns, tuple(detections), view))
        return self.objects()

    def objects(self):
        """The people who are published now, by ID, at the stamp of the newest image."""
        tracks, params = self._buffer.state.tracks, self._params
        tracks = tracks[np.argsort(tracks['id'])]
        published = (tracks['missed_s'] <= params.missed_limit) & (sigma_of(tracks) < params.unsure_limit)
        published |= tracks['status'] == VISIBLE
        published &= (tracks['status'] != OUT_OF_VIEW) | (tracks['unseen_s'] <= params.out_of_view_limit)
        return objects_of(tracks[tracks['confirmed'] & published], self._prediction)

    def _step(self, state, image, observed_s, id_of):
        """One cycle of the tracker, see OutOfSequenceBuffer: the state after an image, and its Matches."""
        stamp_ns, view, params = image.stamp_ns, image.view, self._params
        tracks = self._predict(state, stamp_ns)
        batch = self._measure(state, image)
        rows, columns = associate(tracks, batch, stamp_ns, params, self._outliers)
        matches = Matches(tracks['id'][rows].tolist(), tracks['confirmed'][rows].tolist(), columns.tolist())
        update_matched(tracks, rows, batch.taken(columns), stamp_ns, params, self._outliers)

        others = others_of(state.looks, view, stamp_ns)
        missed = remaining(len(tracks), rows)
        places = miss(tracks, state.tracks, missed, view, others, observed_s, params.max_range)

        kept = self._is_kept(tracks)
        tracks, unmatched = tracks[kept], remaining(len(image.detections), columns)
        new = np.zeros(0, TRACK)
        if len(unmatched):
            new, started = new_targets(tracks, batch.taken(unmatched), stamp_ns, params)
            new['id'] = [id_of(column) for column in unmatched[started].tolist()]
            tracks = np.concatenate((tracks, new))

        looks = carried(others, kept, len(new))
        looks[view.camera] = Look(stamp_ns, view, np.concatenate((places[kept], np.full(len(new), SEEN))))
        stamps_ns = {camera: last_ns for camera, last_ns in state.stamps_ns.items() if stamp_ns - last_ns <= KNOWN_NS}
        stamps_ns[view.camera] = stamp_ns
        return _State(tracks, stamp_ns, stamps_ns, looks), matches

    def _predict(self, state, stamp_ns):
        """The tracks (n,) at a stamp."""
        tracks = state.tracks.copy()
        elapsed_s = 0.0 if state.now_ns is None else (stamp_ns - state.now_ns) / NS
        tracks['mean'], tracks['covariance'] = kalman.predict(tracks['mean'], tracks['covariance'], elapsed_s,
                                                              self._params.acceleration)
        return tracks

    def _measure(self, state, image):
        """The detections of an image as measurements, with their noise."""
        last_ns = state.stamps_ns.get(image.view.camera, image.stamp_ns)
        return sightings_of(image.detections, image.view, (image.stamp_ns - last_ns) / NS, self._noise)

    def _is_kept(self, tracks):
        """Which tracks are kept, (n,); tentative ones only for a moment."""
        limit_s = np.where(tracks['confirmed'], self._params.memory, TENTATIVE_TIMEOUT_S)
        return (tracks['unseen_s'] < limit_s) & (sigma_of(tracks) < MAX_POSITION_STD_M)


def _check(params):
    for name, value in params._asdict().items():
        if not 0 <= value < 1e6:
            raise ValueError('%s is %g; 0 or more expected' % (name, value))
        if name in ('newcomer_density', 'height_sigma') and not value > 0:
            raise ValueError('%s is %g; more than 0 expected' % (name, value))
        if name == 'outlier_share' and not value < 1:
            raise ValueError('%s is %g; less than 1 expected' % (name, value))
