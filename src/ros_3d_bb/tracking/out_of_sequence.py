"""Out-of-sequence measurements: process late images in the order of their stamps, with stable track IDs."""
import collections
import functools
from typing import Any, Callable, Deque, Dict, Iterable, List, NamedTuple, Optional, Tuple

from ros_3d_bb.core.time_sync import MAX_RATE_HZ, NS
from ros_3d_bb.tracking.types import CameraView, Detection

Order = Tuple[int, str]  # of processing: by stamp, then by camera
Match = Tuple[int, bool, int]  # track ID, whether the track was confirmed before, number of the detection
LATEST_NS = NS // 2  # images that are older than the newest by more than this are rejected; chosen
MOST_KEPT = LATEST_NS * MAX_RATE_HZ // NS  # maximum number of images in the history, per camera
MOST_SKIPPED = 1000  # maximum number of skipped images in the history; chosen
# Late images wait until a replay processes at most this many images for each of them, or until the newest stamp has
# advanced by MAX_WAIT_NS. Chosen: late cameras then take less than three times the CPU time of the same images in order
# (test_late_cameras_are_replayed_in_batches), and an image that is late by one or two others does not wait.
REPLAYED_PER_LATE = 3
MAX_WAIT_NS = NS // 5


class DetectedImage(NamedTuple):
    """The detections of one image and the camera's view."""

    stamp_ns: int
    detections: Tuple[Detection, ...]
    view: CameraView

    @property
    def order(self) -> Order:
        """Sort key of the processing order: stamp, then camera."""
        return self.stamp_ns, self.view.camera


class OutOfSequenceBuffer(object):
    """Processes images in the order of their stamps, independent of the order of arrival.

    The buffer keeps the latest images and the state before each of them. For late images, the state is rewound to the
    earliest of them and the later images are replayed, once for several late images if they are many images late.
    Replayed images start the same tracks with the same IDs.

    Parameters
    ----------
    step : callable
        step(state, image, observed_s, assign_id) returns the state after an image, which has `tracks` and `now_ns`,
        and the matches: (track ID, whether the track was confirmed before, number of the detection). `observed_s` is
        the time in seconds that the image accounts for; assign_id(number) returns the ID of the track that a
        detection starts.
    state
        State before the first image.
    last_id : int
        The last assigned ID.
    """

    def __init__(self, step: Callable[..., Tuple[Any, List[Match]]], state: Any, last_id: int = 0) -> None:
        self._step, self.state, self.last_id = step, state, last_id
        self._history: Deque[Tuple[Any, DetectedImage]] = collections.deque()  # (state before, image)
        self._skipped: Deque[Order] = collections.deque(maxlen=MOST_SKIPPED)
        self._late: List[Tuple[Order, Optional[DetectedImage]]] = []  # wait for a replay; None: a skipped image
        self._late_since_ns = 0  # newest stamp when the first of them arrived
        self._ids: Dict[Tuple[int, str, int], int] = {}  # of tracks, by stamp, camera and number of the first detection

    def insert(self, image: DetectedImage) -> None:
        """Process an image, or let it wait. Raises ValueError without any change if it is too late or a duplicate."""
        self._check(image.stamp_ns, image.view.camera)
        is_late = bool(self._history) and image.stamp_ns <= self.state.now_ns and (
            image.order < self._history[-1][1].order)
        if is_late:
            self._add_late(image.order, image)
        if self._late:
            self._replay_if_due(image.stamp_ns)
        if not is_late:
            self._process([image])

    def skip(self, stamp_ns: int, camera: str) -> None:
        """Skip an image whose detections are unavailable: tracks do not age."""
        self._skipped.append((stamp_ns, camera))
        if any(image.view.camera == camera and (state.now_ns or 0) < stamp_ns < image.stamp_ns
               for state, image in self._history):
            self._add_late((stamp_ns, camera), None)
            self._replay_if_due(stamp_ns)

    def replay(self) -> None:
        """Process the late images that wait."""
        if not self._late:
            return
        known_id, images = self.last_id, [image for _order, image in self._late if image is not None]
        images += self._rewind(min(order for order, _image in self._late))
        self._late = []
        self._process(sorted(images, key=lambda image: image.order), known_id)

    def _add_late(self, order: Order, image: Optional[DetectedImage]) -> None:
        if not self._late:
            self._late_since_ns = self.state.now_ns
        self._late.append((order, image))

    def _replay_if_due(self, stamp_ns: int) -> None:
        """Replay if this is efficient, or if the late images have waited too long at the stamp of the next image."""
        first = min(order for order, _image in self._late)
        replayed = len(self._late) + sum(image.order > first for _state, image in self._history)
        has_waited = stamp_ns - self._late_since_ns >= MAX_WAIT_NS
        if has_waited or replayed <= REPLAYED_PER_LATE * len(self._late):
            self.replay()

    def _check(self, stamp_ns: int, camera: str) -> None:
        now_ns, count = self.state.now_ns, len(self._history) + len(self._late)
        if now_ns is None or (stamp_ns > now_ns and count < MOST_KEPT):
            return
        stamps_ns = sorted(other.stamp_ns for _before, other in list(self._history) + self._late
                           if other is not None and other.view.camera == camera)
        if stamp_ns in stamps_ns:
            raise ValueError('duplicate stamp %.9f of camera %r' % (stamp_ns / NS, camera))
        if stamp_ns < now_ns - LATEST_NS:
            raise ValueError('stamp %.9f is %.3f s older than the newest image; at most %.1f s expected'
                             % (stamp_ns / NS, (now_ns - stamp_ns) / NS, LATEST_NS / NS))
        if len(stamps_ns) >= MOST_KEPT and stamp_ns <= stamps_ns[0] + LATEST_NS:
            raise ValueError('stamp %.9f is within %.1f s of those of %d images of camera %r; its clock hangs'
                             % (stamp_ns / NS, LATEST_NS / NS, MOST_KEPT, camera))

    def _rewind(self, order: Order) -> List[DetectedImage]:
        """Rewind to the state before the images after `order`; return those images."""
        images = []
        while self._history and self._history[-1][1].order > order:
            self.state, image = self._history.pop()
            images.append(image)
        return images

    def _process(self, images: Iterable[DetectedImage], known_id: Optional[int] = None) -> None:
        """Process images; `known_id` is the last ID assigned before a rewind, None without a rewind."""
        for image in images:
            self._history.append((self.state, image))
            order = image.order
            self.state, matches = self._step(self.state, image, self._observed_s(*order),
                                             functools.partial(self._assign_id, order))
            if known_id is not None:
                self._restore_ids(order, matches, known_id)
        self._forget()

    def _observed_s(self, stamp_ns: int, camera: str) -> float:
        """Time since the previous image, or since a later skipped image of the same camera, seconds."""
        before_ns = stamp_ns if self.state.now_ns is None else self.state.now_ns
        if not self._skipped:
            return (stamp_ns - before_ns) / NS
        skipped_ns = [skipped_ns for skipped_ns, other in self._skipped if other == camera and skipped_ns < stamp_ns]
        return (stamp_ns - max(skipped_ns + [before_ns])) / NS

    def _assign_id(self, order: Order, number: int) -> int:
        key = order + (number,)
        if key not in self._ids:
            self.last_id += 1
            self._ids[key] = self.last_id
        return self._ids[key]

    def _restore_ids(self, order: Order, matches: List[Match], known_id: int) -> None:
        """Restore the ID of a track that now starts in a late image, but started in a later image before the rewind."""
        for track_id, was_confirmed, number in matches:
            key = order + (number,)
            if key in self._ids and (track_id > known_id or not was_confirmed):
                former = self._ids.pop(key)
                self._ids = {other: former if known == track_id else known for other, known in self._ids.items()}
                for state in [state for state, _image in self._history] + [self.state]:
                    for track in state.tracks:
                        track.id = former if track.id == track_id else track.id

    def _forget(self) -> None:
        oldest_ns = self.state.now_ns - LATEST_NS - MAX_WAIT_NS
        while self._history[0][1].stamp_ns < oldest_ns:
            self._history.popleft()
        before_ns = self._history[0][0].now_ns or 0  # earlier entries have no effect any more
        if self._skipped:
            self._skipped = collections.deque((entry for entry in self._skipped if entry[0] > before_ns), MOST_SKIPPED)
        if self._ids:
            self._ids = {key: track_id for key, track_id in self._ids.items() if key[0] >= oldest_ns}
