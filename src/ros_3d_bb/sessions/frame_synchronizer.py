"""Synchronizer of the messages of one image: colour, depth, camera, 2D boxes and 3D boxes."""
from typing import Any, NamedTuple

from ros_3d_bb.core.time_sync import MessageCache, StampSynchronizer


class Snapshot(NamedTuple):
    """Colour, depth, camera, 2D boxes and 3D boxes of one stamp, as they were added. Missing boxes are None."""

    stamp_ns: int
    color: Any
    depth: Any
    camera: Any
    boxes2d: Any
    boxes3d: Any


class Snapshots(object):
    """Combines messages of five topics, which may arrive in any order, to snapshots.

    The stamps of boxes must be equal to that of the colour image. Depth and camera are matched as in
    `StampSynchronizer`. If time jumps back, older messages are dropped.

    Parameters
    ----------
    length_ns : int
        How long images are kept while their boxes have not arrived.
    tolerance_ns : int
        Maximum difference of the stamps of the colour and the depth image.
    on_lost : callable
        Called with the stamp of a colour image whose depth image or camera did not arrive.
    """

    def __init__(self, length_ns, tolerance_ns, on_lost):
        self._length_ns = length_ns
        self._sync = StampSynchronizer(length_ns, tolerance_ns, 0, self._on_frame, self._on_lost_color)
        self._report_lost = on_lost
        self._images, self._boxes2d, self._boxes3d = (MessageCache(length_ns) for _part in range(3))
        self._first_ns = None

    def add_color(self, stamp_ns, now_ns, color):
        """Add a colour image."""
        self._sync.add_boxes(stamp_ns, now_ns, (stamp_ns, color))

    def add_depth(self, stamp_ns, now_ns, depth):
        """Add a depth image."""
        self._sync.add_depth(stamp_ns, now_ns, depth)

    def add_camera(self, stamp_ns, now_ns, camera):
        """Add the camera of an image, as `StampSynchronizer.add_camera`."""
        self._sync.add_camera(stamp_ns, now_ns, camera)

    def add_boxes2d(self, stamp_ns, now_ns, boxes):
        """Add the 2D boxes of an image."""
        self._boxes2d.add(stamp_ns, now_ns, boxes)

    def add_boxes3d(self, stamp_ns, now_ns, boxes):
        """Add the 3D boxes of an image."""
        self._boxes3d.add(stamp_ns, now_ns, boxes)

    @property
    def newest(self):
        """Newest snapshot that is complete, or else the most complete one; None before the first image."""
        best = None
        for entry in reversed(self._images):
            snapshot = self._snapshot(entry)
            if best is None or _boxes_in(snapshot) > _boxes_in(best):
                best = snapshot
        return best

    @property
    def is_early(self):
        """Whether boxes may be missing because images have been arriving for less than `length_ns`."""
        return self._first_ns is None or self._images.newest_ns - self._first_ns < self._length_ns

    def _snapshot(self, entry):
        color, depth, camera = entry.value
        boxes2d, boxes3d = (cache.nearest(entry.stamp_ns) for cache in (self._boxes2d, self._boxes3d))
        return Snapshot(entry.stamp_ns, color, depth, camera, boxes2d and boxes2d.value,
                        boxes3d and boxes3d.value)

    def _on_frame(self, stamped_color, depth, camera):
        """Keep the images and the camera of one stamp."""
        stamp_ns, color = stamped_color
        went_back = self._images.add(stamp_ns, 0, (color, depth, camera))  # the arrival time is not used
        if went_back:
            self._boxes2d.clear()
            self._boxes3d.clear()
        if went_back or self._first_ns is None:
            self._first_ns = stamp_ns

    def _on_lost_color(self, stamped_color, of_time_before):
        if not of_time_before:
            stamp_ns, _color = stamped_color
            self._report_lost(stamp_ns)


def _boxes_in(snapshot):
    return (snapshot.boxes2d is not None) + (snapshot.boxes3d is not None)
