"""Images that arrive late or in any order: they are processed in the order of their stamps, with stable IDs."""
import collections
from typing import NamedTuple

from ros_3d_bb.core.time_sync import MAX_RATE_HZ, NS
from ros_3d_bb.tracking.types import CameraView

LATEST_NS = NS // 2  # images that are older than the newest by more are refused
MOST_KEPT = LATEST_NS * MAX_RATE_HZ // NS  # images of one camera
MOST_SKIPPED = 1000  # images without an answer that are remembered


class DetectedImage(NamedTuple):
    """The detections of one image, and what its camera saw."""

    stamp_ns: int
    detections: tuple
    view: CameraView

    @property
    def order(self):
        """Images are processed in this order."""
        return self.stamp_ns, self.view.camera


class Matches(NamedTuple):
    """Which tracks were matched in an image: their IDs, whether they were confirmed before, and their detections."""

    ids: list
    confirmed: list
    columns: list


class OutOfSequenceBuffer(object):
    """Processes images in the order of their stamps, whatever the order in which they arrive.

    The latest images are kept with the state before each. A late image rewinds to its place, and the images after it
    are replayed. Replayed images start the same tracks under the same IDs.

    Parameters
    ----------
    step : callable
        step(state, image, observed_s, id_of) returns the state after an image, and its Matches. A state has `tracks`
        and `now_ns`. `observed_s` is the time that the image answers for, id_of(column) the ID of the target that a
        detection starts.
    state
        Before the first image.
    last_id : int
        The last ID that was given.
    """

    def __init__(self, step, state, last_id=0):
        self._step, self.state, self.last_id = step, state, last_id
        self._history = collections.deque()  # (state before, image)
        self._skipped = collections.deque(maxlen=MOST_SKIPPED)  # (stamp_ns, camera)
        self._ids = {}  # IDs of new targets by stamp, camera and column of the detection that started them

    def insert(self, image):
        """Process an image. Raises ValueError, and changes nothing, if it comes too late or a second time."""
        self._check(image)
        later = self._rewind(image.order)
        self._replay([image] + later, self.last_id if later else None)

    def skip(self, stamp_ns, camera):
        """Let an image pass that has no answer: tracks do not age for it."""
        self._skipped.append((stamp_ns, camera))
        if any(image.view.camera == camera and (state.now_ns or 0) < stamp_ns < image.stamp_ns
               for state, image in self._history):
            self._replay(self._rewind((stamp_ns, camera)), self.last_id)

    def _check(self, image):
        stamp_ns, now_ns = image.stamp_ns, self.state.now_ns
        stamps_ns = [other.stamp_ns for _state, other in self._history if other.view.camera == image.view.camera]
        if stamp_ns in stamps_ns:
            raise ValueError('stamp %.9f of camera %r comes a second time' % (stamp_ns / NS, image.view.camera))
        if now_ns is not None and stamp_ns < now_ns - LATEST_NS:
            raise ValueError('stamp %.9f is %.3f s before the latest, more than %.1f s late'
                             % (stamp_ns / NS, (now_ns - stamp_ns) / NS, LATEST_NS / NS))
        if len(stamps_ns) >= MOST_KEPT and stamp_ns <= stamps_ns[0] + LATEST_NS:
            raise ValueError('stamp %.9f is within %.1f s of those of %d images of camera %r; its stamps stand still'
                             % (stamp_ns / NS, LATEST_NS / NS, MOST_KEPT, image.view.camera))

    def _rewind(self, order):
        """Go back to the state before the images that come after `order`; returns those, oldest first."""
        images = []
        while self._history and self._history[-1][1].order > order:
            self.state, image = self._history.pop()
            images.insert(0, image)
        return images

    def _replay(self, images, known_id):
        """Process images; `known_id` is the last ID given before a rewind, None if there was none."""
        for image in images:
            before = self.state
            self._history.append((before, image))
            self.state, matches = self._step(before, image, self._observed_s(image), self._ids_for(image))
            if known_id is not None:
                self._restore_ids(image, matches, known_id)
        self._forget()

    def _observed_s(self, image):
        """The time since the image before, or since a skipped one of the same camera."""
        stamp_ns, camera = image.stamp_ns, image.view.camera
        before_ns = stamp_ns if self.state.now_ns is None else self.state.now_ns
        skipped_ns = [skipped_ns for skipped_ns, other in self._skipped if other == camera and skipped_ns < stamp_ns]
        return (stamp_ns - max(skipped_ns + [before_ns])) / NS

    def _ids_for(self, image):
        def id_of(column):
            key = image.order + (column,)
            if key not in self._ids:
                self.last_id += 1
                self._ids[key] = self.last_id
            return self._ids[key]
        return id_of

    def _restore_ids(self, image, matches, known_id):
        """Give a track that a late image started the ID of the track that one of its later detections had started."""
        for track_id, was_confirmed, column in zip(*matches):
            key = image.order + (column,)
            if key in self._ids and (track_id > known_id or not was_confirmed):
                former = self._ids.pop(key)
                self._ids = {other: former if known == track_id else known for other, known in self._ids.items()}
                for state in [state for state, _image in self._history] + [self.state]:
                    state.tracks['id'][state.tracks['id'] == track_id] = former

    def _forget(self):
        oldest_ns = self.state.now_ns - LATEST_NS
        while self._history[0][1].stamp_ns < oldest_ns:
            self._history.popleft()
        before_ns = self._history[0][0].now_ns or 0  # nothing earlier can count again
        self._skipped = collections.deque((entry for entry in self._skipped if entry[0] > before_ns), MOST_SKIPPED)
        self._ids = {key: number for key, number in self._ids.items() if key[0] >= oldest_ns}
