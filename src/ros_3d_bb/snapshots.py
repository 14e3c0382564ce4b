"""What the camera and the pipeline say of one image, put together by its stamp."""
from typing import Any, NamedTuple

from ros_3d_bb.stamped import Pairing, StampedCache


class Snapshot(NamedTuple):
    """Colour, depth, camera, 2D boxes and 3D boxes of one stamp, as they were added; boxes that have not come are
    None.
    """

    stamp_ns: int
    color: Any
    depth: Any
    camera: Any
    boxes2d: Any
    boxes3d: Any


class Snapshots(object):
    """Puts snapshots together of what comes on five topics, in any order.

    The stamps of boxes are exactly those of the colour image; depth and camera are paired as for `Pairing`. Where
    time goes back, everything of the time before is forgotten.

    Parameters
    ----------
    length_ns : int
        How long images are kept for the boxes that come for them.
    tolerance_ns : int
        By how much the stamps of colour and depth image may differ.
    on_lost : callable
        Called with the stamp of a colour image whose depth image or camera did not arrive.
    """

    def __init__(self, length_ns, tolerance_ns, on_lost):
        self._length_ns = length_ns
        self._sync = Pairing(length_ns, tolerance_ns, 0, self._on_frame, self._on_lost_color)
        self._report_lost = on_lost
        self._images, self._boxes2d, self._boxes3d = (StampedCache(length_ns) for _part in range(3))
        self._first_ns = None

    def add_color(self, stamp_ns, now_ns, color):
        """Take a colour image."""
        self._sync.add_boxes(stamp_ns, now_ns, (stamp_ns, color))

    def add_depth(self, stamp_ns, now_ns, depth):
        """Take a depth image."""
        self._sync.add_depth(stamp_ns, now_ns, depth)

    def add_camera(self, stamp_ns, now_ns, camera):
        """Take the camera of an image, as `Pairing.add_camera`."""
        self._sync.add_camera(stamp_ns, now_ns, camera)

    def add_boxes2d(self, stamp_ns, now_ns, boxes):
        """Take the 2D boxes of an image."""
        self._boxes2d.add(stamp_ns, now_ns, boxes)

    def add_boxes3d(self, stamp_ns, now_ns, boxes):
        """Take the 3D boxes of an image."""
        self._boxes3d.add(stamp_ns, now_ns, boxes)

    @property
    def newest(self):
        """The newest snapshot that has all parts; where none has, that which has most; None before any image."""
        best = None
        for entry in reversed(self._images):
            snapshot = self._snapshot(entry)
            if best is None or _boxes_in(snapshot) > _boxes_in(best):
                best = snapshot
        return best

    @property
    def is_early(self):
        """Whether boxes may still be on their way, as images have come for less than they may take."""
        return self._first_ns is None or self._images.newest_ns - self._first_ns < self._length_ns

    def _snapshot(self, entry):
        color, depth, camera = entry.value
        boxes2d, boxes3d = (cache.at(entry.stamp_ns) for cache in (self._boxes2d, self._boxes3d))
        return Snapshot(entry.stamp_ns, color, depth, camera, boxes2d and boxes2d.value,
                        boxes3d and boxes3d.value)

    def _on_frame(self, stamped_color, depth, camera):
        """Keep the images and the camera of one stamp."""
        stamp_ns, color = stamped_color
        went_back = self._images.add(stamp_ns, 0, (color, depth, camera))  # its arrival does not matter
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
