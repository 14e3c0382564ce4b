"""Out-of-sequence measurements: process late images in the order of their stamps, with stable track IDs."""
import collections
import functools
from typing import NamedTuple

from ros_3d_bb.core.time_sync import MAX_RATE_HZ, NS
from ros_3d_bb.tracking.types import CameraView

LATEST_NS = NS // 2  # images that are older than the newest by more than this are rejected
MOST_KEPT = LATEST_NS * MAX_RATE_HZ // NS  # maximum number of images in the history, per camera
MOST_SKIPPED = 1000  # maximum number of skipped images in the history


class DetectedImage(NamedTuple):
    """The detections of one image and the camera's view."""

    stamp_ns: int
    detections: tuple
    view: CameraView

    @property
    def order(self):
        """Sort key of the processing order: stamp, then camera."""
        return self.stamp_ns, self.view.camera


class OutOfSequenceBuffer(object):
    """Processes images in the order of their stamps, independent of the order of arrival.

    The buffer keeps the latest images and the state before each of them. For a late image, the state is rewound to its
    stamp and the later images are replayed. Replayed images start the same tracks with the same IDs.

    Parameters
    ----------
    step : callable
        step(state, image, observed_s, assign_id) returns the state after an image, which has `tracks` and `now_ns`,
        and the matches: (track ID, whether the track was confirmed before, index of the detection). `observed_s` is
        the time in seconds that the image accounts for; assign_id(column) returns the ID of the track that a
        detection starts.
    state
        State before the first image.
    last_id : int
        The last assigned ID.
    """

    def __init__(self, step, state, last_id=0):
        self._step, self.state, self.last_id = step, state, last_id
        self._history = collections.deque()  # (state before, image)
        self._skipped = collections.deque(maxlen=MOST_SKIPPED)  # (stamp_ns, camera)
        self._ids = {}  # IDs of new targets by stamp, camera and column of the detection that started them

    def insert(self, image):
        """Process an image. Raises ValueError without any change if the image is too late or a duplicate."""
        self._check(image.stamp_ns, image.view.camera)
        later = self._rewind(image.order)
        self._replay([image] + later, self.last_id if later else None)

    def skip(self, stamp_ns, camera):
        """Skip an image whose detections are unavailable: tracks do not age."""
        self._skipped.append((stamp_ns, camera))
        if any(image.view.camera == camera and (state.now_ns or 0) < stamp_ns < image.stamp_ns
               for state, image in self._history):
            self._replay(self._rewind((stamp_ns, camera)), self.last_id)

    def _check(self, stamp_ns, camera):
        now_ns = self.state.now_ns
        stamps_ns = [other.stamp_ns for _state, other in self._history if other.view.camera == camera]
        if stamp_ns in stamps_ns:
            raise ValueError('duplicate stamp %.9f of camera %r' % (stamp_ns / NS, camera))
        if now_ns is not None and stamp_ns < now_ns - LATEST_NS:
            raise ValueError('stamp %.9f is %.3f s older than the newest image; at most %.1f s expected'
                             % (stamp_ns / NS, (now_ns - stamp_ns) / NS, LATEST_NS / NS))
        if len(stamps_ns) >= MOST_KEPT and stamp_ns <= stamps_ns[0] + LATEST_NS:
            raise ValueError('stamp %.9f is within %.1f s of those of %d images of camera %r; its clock hangs'
                             % (stamp_ns / NS, LATEST_NS / NS, MOST_KEPT, camera))

    def _rewind(self, order):
        """Rewind to the state before the images after `order`; return those images, oldest first."""
        images = []
        while self._history and self._history[-1][1].order > order:
            self.state, image = self._history.pop()
            images.insert(0, image)
        return images

    def _replay(self, images, known_id):
        """Process images; `known_id` is the last ID assigned before a rewind, None without a rewind."""
        for image in images:
            self._history.append((self.state, image))
            self.state, matches = self._step(self.state, image, self._observed_s(*image.order),
                                             functools.partial(self._assign_id, image.order))
            if known_id is not None:
                self._restore_ids(image.order, matches, known_id)
        self._forget()

    def _observed_s(self, stamp_ns, camera):
        """Time since the previous image, or since a later skipped image of the same camera, seconds."""
        before_ns = stamp_ns if self.state.now_ns is None else self.state.now_ns
        skipped_ns = [skipped_ns for skipped_ns, other in self._skipped if other == camera and skipped_ns < stamp_ns]
        return (stamp_ns - max(skipped_ns + [before_ns])) / NS

    def _assign_id(self, order, column):
        key = order + (column,)
        if key not in self._ids:
            self.last_id += 1
            self._ids[key] = self.last_id
        return self._ids[key]

    def _restore_ids(self, order, matches, known_id):
        """Restore the ID of a track that now starts in a late image, but started in a later image before the rewind."""
        for track_id, was_confirmed, column in matches:
            key = order + (column,)
            if key in self._ids and (track_id > known_id or not was_confirmed):
                former = self._ids.pop(key)
                self._ids = {other: former if known == track_id else known for other, known in self._ids.items()}
                for state in [state for state, _image in self._history] + [self.state]:
                    state.tracks['id'][state.tracks['id'] == track_id] = former

    def _forget(self):
        oldest_ns = self.state.now_ns - LATEST_NS
        while self._history[0][1].stamp_ns < oldest_ns:
            self._history.popleft()
        before_ns = self._history[0][0].now_ns or 0  # earlier entries have no effect any more
        self._skipped = collections.deque((entry for entry in self._skipped if entry[0] > before_ns), MOST_SKIPPED)
        self._ids = {key: track_id for key, track_id in self._ids.items() if key[0] >= oldest_ns}
