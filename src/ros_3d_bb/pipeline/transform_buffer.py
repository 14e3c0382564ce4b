"""tf2 buffer that accepts transforms again after a backward jump in time."""
import collections
from typing import Deque, Dict, List, Mapping, Set, Tuple

import genpy
import numpy as np
import tf2_ros
from geometry_msgs.msg import TransformStamped

from ros_3d_bb.camera.alignment import viewing_fault
from ros_3d_bb.conversions.perception_msgs import NEWEST, transform_from_msg
from ros_3d_bb.core.senders import Senders

CACHE_S = 10.0  # tf2 rejects transforms that are older than the newest one of their frame by more
REJECTED = 2  # transforms in sequence that tf2 rejects after a jump, and not because one is late; chosen
MOST_RECENT = 1000  # recent transforms that are kept; chosen: some seconds of /tf of a Jackal, some megabytes


def path_to_root(parents: Mapping[str, str], frame: str) -> List[str]:
    path = [frame]
    while path[-1] in parents and parents[path[-1]] not in path:
        path.append(parents[path[-1]])
    return path


def upright_transform(transforms: 'TransformBuffer', floor_frame: str, camera_frame: str) -> Tuple[str, np.ndarray]:
    """Return a frame whose z axis points up, and the latest transform (4, 4) from it to a camera: `floor_frame`, or,
    without a transform from it, the root of the tree of the camera, such as map or odom of a robot without base_link.

    Raises tf2_ros.TransformException if there is none: an optical frame as the root does not point up.
    """
    try:
        return floor_frame, transforms.lookup(camera_frame, floor_frame, NEWEST)
    except tf2_ros.TransformException:
        root = transforms.ancestors(camera_frame)[-1]
        camera_from_root = transforms.lookup(camera_frame, root, NEWEST)
        if viewing_fault(root, np.linalg.inv(camera_from_root)):
            raise
        return root, camera_from_root


class TransformBuffer(tf2_ros.BufferCore):
    """tf2 buffer for `lookup` at the stamps of images.

    After a backward jump in time, or one transform with a stamp in the future, tf2 rejects the transforms of a frame.
    If a lookup at their time fails because of this, or at `forget_later`, the buffer is cleared, except for static
    transforms, and the recent transforms up to that time are added again. Rejected transforms of other frames, or of
    another time than that of the lookup, have no effect, as in tf2.
    """

    def __init__(self) -> None:
        tf2_ros.BufferCore.__init__(self)
        self._parents: Dict[str, str] = {}
        self._start()

    def _start(self) -> None:
        # By child frame; of the rejected transforms in sequence, number and stamp of the latest one.
        self._newest_s: Dict[str, float] = {}
        self._rejected_before_s: Dict[str, float] = {}
        self._rejected: Dict[str, Tuple[int, float]] = {}
        self._recent: Deque[Tuple[TransformStamped, str]] = collections.deque(maxlen=MOST_RECENT)  # also rejected ones

    def set_transform(self, transform: TransformStamped, authority: str) -> None:
        child, stamp_s = _child_of(transform), transform.header.stamp.to_sec()
        newest_s = self._newest_s[child] = max(stamp_s, self._newest_s.get(child, stamp_s))
        if stamp_s < newest_s - CACHE_S:
            self._rejected_before_s[child] = newest_s - CACHE_S
            self._rejected[child] = self._rejected.get(child, (0, 0.0))[0] + 1, stamp_s
        else:
            self._rejected.pop(child, None)
        self._recent.append((transform, authority))
        self._parents[child] = transform.header.frame_id.lstrip('/')
        tf2_ros.BufferCore.set_transform(self, transform, authority)

    def set_transform_static(self, transform: TransformStamped, authority: str) -> None:
        self._parents[_child_of(transform)] = transform.header.frame_id.lstrip('/')
        tf2_ros.BufferCore.set_transform_static(self, transform, authority)

    def clear(self) -> None:
        tf2_ros.BufferCore.clear(self)
        self._start()

    def lookup(self, target_frame: str, source_frame: str, stamp: genpy.Time) -> np.ndarray:
        """Look up `target_from_source`, a 4x4 matrix, at a stamp. Raises tf2_ros.TransformException."""
        target, source = target_frame.lstrip('/'), source_frame.lstrip('/')
        try:
            return transform_from_msg(self.lookup_transform_core(target, source, stamp))
        except tf2_ros.TransformException:
            between, stamp_s = self._between(target, source), stamp.to_sec()  # the stamp 0 means the latest transform
            if not any(0 < stamp_s < self._rejected_before_s.get(frame, 0) for frame in between):
                raise
        self._clear_after(stamp.to_sec() + CACHE_S)
        return transform_from_msg(self.lookup_transform_core(target, source, stamp))

    def ancestors(self, frame: str) -> List[str]:
        return path_to_root(self._parents, frame.lstrip('/'))

    def forget_later(self, target_frame: str, source_frame: str) -> None:
        """Forget what is later than the latest transforms of a frame between two others, if those were rejected."""
        between = self._between(target_frame.lstrip('/'), source_frame.lstrip('/'))
        rejected = [self._rejected[frame] for frame in between if frame in self._rejected]
        stamps_s = [stamp_s for count, stamp_s in rejected if count >= REJECTED]
        if stamps_s:
            self._clear_after(max(stamps_s) + CACHE_S)

    def link_to_root(self, target_frame: str, frame: str, target_from_frame: np.ndarray) -> Tuple[str, str, np.ndarray]:
        """The transform (parent, child, parent_from_child (4, 4)) to the root of the tree of a frame that gives it a
        pose (4, 4) in a frame that tf does not contain.

        Raises ValueError if the transforms already contain the frame in `target_frame`.
        """
        target, frame = target_frame.lstrip('/'), frame.lstrip('/')
        root = path_to_root(self._parents, frame)[-1]
        if root == target:
            raise ValueError('tf contains the pose of %s in %s already; one without it expected (--camera-height, '
                             '--camera-pose; camera_height:=, camera_pose:=)' % (frame, target))
        return target, root, target_from_frame.dot(self.lookup(frame, root, NEWEST))

    def senders(self) -> Dict[str, Tuple[str, ...]]:
        """{frame: names of the nodes} of the recent frames that several nodes publish at once, see `Senders`."""
        found: Dict[str, Senders] = collections.defaultdict(Senders)
        for transform, authority in list(self._recent):
            found[_child_of(transform)].add(authority)
        return {frame: nodes for frame, nodes in ((frame, each.take()) for frame, each in found.items()) if nodes}

    def _between(self, target: str, source: str) -> Set[str]:
        return set(path_to_root(self._parents, target)) ^ set(path_to_root(self._parents, source))

    def _clear_after(self, stamp_s: float) -> None:
        recent = list(self._recent)  # a copy, as another thread may add transforms
        self.clear()
        for transform, authority in recent:
            if transform.header.stamp.to_sec() <= stamp_s:
                self.set_transform(transform, authority)


def _child_of(transform: TransformStamped) -> str:
    return transform.child_frame_id.lstrip('/')
