"""The tracker: who is where, how fast, and where in two seconds, from the boxes of image after image.

Each person is a constant-velocity Kalman filter in the plane (`kalman`). Boxes are given to people by the sum of their
likelihoods, those seen a moment ago first; a box that a newcomer explains better than any of them starts a new track,
which is published once it was seen often enough. Who is not seen is carried on: published for a moment where the
camera should have found them, for longer where somebody or something hides them (`visibility`, `unseen`), and
remembered for longer still, so that they get their number back.
"""
import collections
from typing import NamedTuple

import numpy as np

from ros_3d_bb.stamped import MAX_RATE_HZ, NS
from ros_3d_bb.tracking import kalman
from ros_3d_bb.tracking.association import assign, remaining
from ros_3d_bb.tracking.measuring import NoiseParams, sightings_of
from ros_3d_bb.tracking.prediction import PredictionParams, objects_of
from ros_3d_bb.tracking.tracked import OUT_OF_VIEW, VISIBLE, View, check_steps
from ros_3d_bb.tracking.unseen import SEEN, Look, carried, miss, others_of, sigma_of

TRACK = np.dtype([('id', int), ('mean', float, 4), ('covariance', float, (4, 4)), ('z_m', float), ('z_m2', float),
                  ('size_m', float, 3), ('end_hits', int, 2), ('sightings', int), ('first_ns', np.int64),
                  ('last_ns', np.int64), ('missed_s', float), ('unseen_s', float), ('status', int),
                  ('confirmed', bool), ('moving', bool)])
LATEST_NS = NS // 2  # images that come later than others by more are refused
MOST_KEPT = LATEST_NS * MAX_RATE_HZ // NS  # images of one camera, to take late ones in
KNOWN_NS = 60 * NS  # a camera that sent nothing for longer, while others did, is a new one
MOST_SKIPPED = 1000  # where no camera has an answer; the newest ones count
RECENT_NS = 7 * NS // 10  # who was seen so recently comes before those who were away
LOST_M = 2.4  # who may be anywhere within this (standard deviation) is forgotten
TRIES_S = 0.6  # how long a track that is not confirmed yet waits to be seen again
UNSURE_SHARE = 0.1  # of the density of a box at its centre: a newcomer's is not higher
TAKEN_NS = NS // 5  # nobody new begins near somebody seen so recently
SMOOTHING = 0.1  # share of the newest sighting in size and height
CUT_SMOOTHING = 0.02  # the same where the image border cuts the box on a side: the head may be outside
HEAD_SIGMAS = 2.0  # the top of a head is known this much less well than a height: the camera tilts as the robot drives
STILL_MOVING = 0.5  # of the speed at which somebody begins to move


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


class _Image(NamedTuple):
    stamp_ns: int
    detections: tuple
    view: View


class _State(NamedTuple):
    """What images change: the tracks, and the stamp of the latest image; by camera, that of its latest one, and its
    `unseen.Look`.
    """

    tracks: np.ndarray
    now_ns: int
    stamps_ns: dict
    looks: dict


class Tracker(object):
    """Tracks people from image to image.

    Call `update` with the detections of each image, `skip` for an image whose detections could not be used, `reset`
    where time jumped. Images of several cameras may come in any order, and late: what happened since is done again with
    them.

    Raises
    ------
    ValueError
        If a parameter makes no sense; names it.
    """

    def __init__(self, params=TrackerParams(), noise=NoiseParams(), prediction=PredictionParams()):
        self.tune(params, noise, prediction)
        self._last_id = 0
        self.reset()

    def tune(self, params, noise, prediction):
        """Go on with other parameters and the same tracks. Raises ValueError as at the start, and changes nothing."""
        for kind in (params, noise, prediction):
            _check(kind)
        check_steps(prediction.prediction_time, prediction.prediction_step)
        self._params, self._noise, self._prediction = params, noise, prediction
        self._outliers = kalman.Outliers(params.outlier_share, params.outlier_offset, params.outlier_spread)

    def reset(self):
        """Forget all tracks, as after a jump in time. Numbers are not used again."""
        self._state = _State(np.zeros(0, TRACK), None, {}, {})
        self._history = collections.deque()  # (state before, image) of the latest images
        self._skipped = collections.deque(maxlen=MOST_SKIPPED)  # (stamp_ns, camera) of those without an answer
        self._ids = {}  # of the tracks begun in them, by stamp, camera and number of the detection

    def skip(self, stamp_ns, camera=''):
        """Let an image pass whose detections could not be used: nobody ages. Never an error: it may be late."""
        self._skipped.append((stamp_ns, camera))
        if any(image.view.camera == camera and (state.now_ns or 0) < stamp_ns < image.stamp_ns
               for state, image in self._history):
            self._take(self._taken_back(stamp_ns, camera), self._last_id)

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
            By id, at the stamp of the newest image.

        Raises
        ------
        ValueError
            If the image comes too late, or a second time; nothing changes then.
        """
        self._check_stamp(stamp_ns, view.camera)
        later = self._taken_back(stamp_ns, view.camera)
        self._take([_Image(stamp_ns, tuple(detections), view)] + later, self._last_id if later else None)
        return self.objects()

    def objects(self):
        """The people who are published now, by id, at the stamp of the newest image."""
        tracks, params = self._state.tracks, self._params
        tracks = tracks[np.argsort(tracks['id'])]
        known = (tracks['missed_s'] <= params.missed_limit) & (sigma_of(tracks) < params.unsure_limit)
        known |= tracks['status'] == VISIBLE
        known &= (tracks['status'] != OUT_OF_VIEW) | (tracks['unseen_s'] <= params.out_of_view_limit)
        return objects_of(tracks[tracks['confirmed'] & known], self._prediction)

    def _check_stamp(self, stamp_ns, camera):
        stamps_ns = [image.stamp_ns for _state, image in self._history if image.view.camera == camera]
        if stamp_ns in stamps_ns:
            raise ValueError('stamp %.9f of camera %r comes a second time' % (stamp_ns / NS, camera))
        if self._state.now_ns is not None and stamp_ns < self._state.now_ns - LATEST_NS:
            raise ValueError('stamp %.9f is %.3f s before the latest, more than %.1f s late'
                             % (stamp_ns / NS, (self._state.now_ns - stamp_ns) / NS, LATEST_NS / NS))
        if len(stamps_ns) >= MOST_KEPT and stamp_ns <= stamps_ns[0] + LATEST_NS:
            raise ValueError('stamp %.9f is within %.1f s of those of %d images of camera %r; its stamps stand still'
                             % (stamp_ns / NS, LATEST_NS / NS, MOST_KEPT, camera))

    def _taken_back(self, stamp_ns, camera):
        """Undo the images after a stamp, and of the same one those of cameras with a later name; returns them, oldest
        first."""
        images = []
        while self._history and _order(self._history[-1][1]) > (stamp_ns, camera):
            self._state, image = self._history.pop()
            images.insert(0, image)
        return images

    def _take(self, images, given_id):
        """Go on with images. Where that is done again, numbers up to `given_id` were given before; else None."""
        for image in images:
            self._history.append((self._state, image))
            self._state = self._after(image, given_id)
        self._forget_history()

    def _forget_history(self):
        oldest_ns = self._state.now_ns - LATEST_NS
        while self._history[0][1].stamp_ns < oldest_ns:
            self._history.popleft()
        before_ns = self._history[0][0].now_ns or 0  # nothing earlier can count again
        self._skipped = collections.deque((entry for entry in self._skipped if entry[0] > before_ns), MOST_SKIPPED)
        self._ids = {key: number for key, number in self._ids.items() if key[0] >= oldest_ns}

    def _after(self, image, given_id):
        """The state after an image; `given_id` as in `_take`."""
        before, now_ns, stamps_ns, looks = self._state
        tracks, stamp_ns, view = before.copy(), image.stamp_ns, image.view
        elapsed_s = 0.0 if now_ns is None else (stamp_ns - now_ns) / NS
        tracks['mean'], tracks['covariance'] = kalman.predict(tracks['mean'], tracks['covariance'], elapsed_s,
                                                              self._params.acceleration)
        since_last_s = (stamp_ns - stamps_ns.get(view.camera, stamp_ns)) / NS
        sightings = sightings_of(image.detections, view, since_last_s, self._noise)
        rows, columns = self._associate(tracks, sightings, stamp_ns)
        if given_id is not None:
            self._give_back_ids(tracks, rows, [(stamp_ns, view.camera, column) for column in columns], given_id)
        self._see(tracks, rows, sightings.taken(columns), stamp_ns)
        others = others_of(looks, view, stamp_ns)
        places = miss(tracks, before, remaining(len(tracks), rows), view, others, self._looked_s(image),
                      self._params.max_range)
        kept, newcomers = self._is_remembered(tracks), np.zeros(0, TRACK)
        tracks, unknown = tracks[kept], remaining(len(image.detections), columns)
        if len(unknown):
            newcomers = self._newcomers(tracks, sightings.taken(unknown), unknown, image)
            tracks = np.concatenate((tracks, newcomers))
        looks = carried(others, kept, len(newcomers))
        looks[view.camera] = Look(stamp_ns, view, np.concatenate((places[kept], np.full(len(newcomers), SEEN))))
        known_ns = {camera: last_ns for camera, last_ns in stamps_ns.items() if stamp_ns - last_ns <= KNOWN_NS}
        return _State(tracks, stamp_ns, dict(known_ns, **{view.camera: stamp_ns}), looks)

    def _looked_s(self, image):
        """The time that an image answers for: since the one before, or since one of its camera that had no answer."""
        stamp_ns, camera = image.stamp_ns, image.view.camera
        before_ns = stamp_ns if self._state.now_ns is None else self._state.now_ns
        skipped_ns = [skipped_ns for skipped_ns, other in self._skipped if other == camera and skipped_ns < stamp_ns]
        return (stamp_ns - max(skipped_ns + [before_ns])) / NS

    def _associate(self, tracks, sightings, stamp_ns):
        """Rows of tracks and columns of sightings that belong together."""
        params = self._params
        cost = kalman.unlikeliness(tracks['mean'], tracks['covariance'], sightings.ground, self._outliers)
        cost += _height_cost(tracks, sightings, params.height_sigma)
        # The more unsure a box, the less it tells anybody from a newcomer; it is then somebody's rather than nobody's.
        sharpest = 1 / (2 * np.pi * np.sqrt(np.linalg.det(sightings.ground.noise_m2)))
        density = np.minimum(params.newcomer_density, UNSURE_SHARE * sharpest)
        cost[cost >= -2 * np.log(2 * np.pi * density)] = np.inf
        away = stamp_ns - tracks['last_ns'] >= RECENT_NS
        rank = np.where(tracks['confirmed'], away.astype(int), 2)
        pairs = []
        for turn in range(3):
            rows = np.flatnonzero(rank == turn)
            if len(rows):
                columns = remaining(cost.shape[1], [column for _row, column in pairs])
                pairs += [(rows[row], columns[column]) for row, column in assign(cost[rows[:, None], columns])]
        return np.array(pairs, int).reshape(-1, 2).T

    def _see(self, tracks, rows, sightings, stamp_ns):
        """Update the tracks in `rows` with one sighting each."""
        seen = tracks[rows]
        seen['mean'], seen['covariance'] = kalman.update(seen['mean'], seen['covariance'], sightings.ground,
                                                         self._outliers)
        seen['sightings'] += 1
        seen['last_ns'], seen['unseen_s'], seen['missed_s'], seen['status'] = stamp_ns, 0, 0, VISIBLE
        seen['confirmed'] |= ((seen['sightings'] >= self._params.min_sightings) &
                              (stamp_ns - seen['first_ns'] >= self._params.min_age * NS))
        speed = np.linalg.norm(seen['mean'][:, 2:], axis=1)
        seen['moving'] = speed >= self._params.moving_speed * np.where(seen['moving'], STILL_MOVING, 1)
        _update_size(seen, sightings)
        tracks[rows] = seen

    def _is_remembered(self, tracks):
        """Which tracks are kept; those that are not confirmed yet only for a few more tries."""
        limit_s = np.where(tracks['confirmed'], self._params.memory, TRIES_S)
        return (tracks['unseen_s'] < limit_s) & (sigma_of(tracks) < LOST_M)

    def _newcomers(self, tracks, sightings, columns, image):
        """Tracks of sightings that belong to nobody and do not double anybody."""
        new = np.zeros(len(columns), TRACK)
        new['mean'][:, :2] = sightings.ground.positions_m
        new['covariance'][:, :2, :2] = sightings.ground.noise_m2
        new['covariance'][:, [2, 3], [2, 3]] = self._params.initial_speed ** 2
        new['size_m'], new['z_m'], new['z_m2'] = sightings.sizes_m, sightings.z_m, sightings.z_m2
        new['end_hits'] = ~sightings.vertical_cuts
        new['sightings'], new['first_ns'], new['last_ns'] = 1, image.stamp_ns, image.stamp_ns
        taken_m = tracks['mean'][image.stamp_ns - tracks['last_ns'] < TAKEN_NS, :2]
        kept = []
        for row, column in enumerate(columns):
            others_m = np.concatenate((taken_m, new['mean'][kept, :2]))
            if (np.linalg.norm(others_m - new['mean'][row, :2], axis=1) >= self._params.duplicate_distance).all():
                kept.append(row)
                new['id'][row] = self._id_of((image.stamp_ns, image.view.camera, column))
        return new[kept]

    def _id_of(self, key):
        """The number of a track by its first detection, so that done again it gets the same one."""
        if key not in self._ids:
            self._last_id += 1
            self._ids[key] = self._last_id
        return self._ids[key]

    def _give_back_ids(self, tracks, rows, keys, given_id):
        """Call tracks that late images began by the number of the track that one of their next detections had begun."""
        for row, key in zip(rows, keys):
            number = tracks['id'][row]
            if key in self._ids and (number > given_id or not tracks['confirmed'][row]):
                former = self._ids.pop(key)
                self._ids = {other: former if known == number else known for other, known in self._ids.items()}
                for known in [state.tracks for state, _image in self._history] + [tracks]:
                    known['id'][known['id'] == number] = former


def _height_cost(tracks, sightings, sigma_m):
    """What the heights of sightings cost in the association, (n, m), as negative log likelihood.

    Where the image border cuts a box, or always cut those of a track, the height is not known: the top of the head is
    compared if both have seen it, else nothing.
    """
    seen, cut = tracks['end_hits'] > 0, sightings.vertical_cuts
    cost = ((tracks['size_m'][:, 2:] - sightings.sizes_m[:, 2]) / sigma_m) ** 2 / 2
    heights_known = seen.all(axis=1)[:, None] & ~cut.any(axis=1)
    if heights_known.all():
        return cost
    tops_m = tracks['z_m'] + tracks['size_m'][:, 2] / 2, sightings.z_m + sightings.sizes_m[:, 2] / 2
    top_cost = ((tops_m[0][:, None] - tops_m[1]) / (HEAD_SIGMAS * sigma_m)) ** 2 / 2
    top_cost[~(seen[:, 1:] & ~cut[:, 1])] = 0
    return np.where(heights_known, cost, top_cost)


def _update_size(seen, sightings):
    """Smooth the size and the height of tracks by one sighting each.

    Lower and upper end are smoothed apart: an end that the image border cuts off stays where it was last seen. Until
    it is seen for the first time it is where the estimator expects it.
    """
    cut = sightings.vertical_cuts
    seen['end_hits'] += ~cut
    end_share = np.maximum(SMOOTHING, 1 / np.maximum(seen['end_hits'], 1))
    end_share[cut & (seen['end_hits'] > 0)] = 0
    share = np.maximum(SMOOTHING, 1 / seen['sightings'])
    share[sightings.cut_sideways] = CUT_SMOOTHING
    end_share = np.minimum(end_share, np.where(sightings.cut_sideways, CUT_SMOOTHING, 1)[:, None])
    up_m, taller_m = sightings.z_m - seen['z_m'], sightings.sizes_m[:, 2] - seen['size_m'][:, 2]
    lower_m, upper_m = end_share[:, 0] * (up_m - taller_m / 2), end_share[:, 1] * (up_m + taller_m / 2)
    seen['size_m'][:, :2] += share[:, None] * (sightings.sizes_m[:, :2] - seen['size_m'][:, :2])
    seen['size_m'][:, 2] += upper_m - lower_m
    seen['z_m'] += (lower_m + upper_m) / 2
    seen['z_m2'] += end_share.mean(axis=1) * (sightings.z_m2 - seen['z_m2'])


def _order(image):
    return image.stamp_ns, image.view.camera


def _check(params):
    for name, value in params._asdict().items():
        if not 0 <= value < 1e6:
            raise ValueError('%s is %g; 0 or more expected' % (name, value))
        if name in ('newcomer_density', 'height_sigma') and not value > 0:
            raise ValueError('%s is %g; more than 0 expected' % (name, value))
        if name == 'outlier_share' and not value < 1:
            raise ValueError('%s is %g; less than 1 expected' % (name, value))
