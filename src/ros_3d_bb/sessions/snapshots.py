"""Synchronizer of the messages of one image: colour, depth, camera, 2D boxes and 3D boxes."""
from typing import NamedTuple, Optional, Tuple

import numpy as np

from ros_3d_bb.camera.camera_model import Camera
from ros_3d_bb.camera.images import DepthImage
from ros_3d_bb.core.time_sync import MessageCache, StampSynchronizer
from ros_3d_bb.estimation.box3d import Box3D


class ColorImage(NamedTuple):
    """Colour image (height, width, 3), uint8, RGB, and the frame of its camera."""

    pixels: np.ndarray
    frame_id: str


class Snapshot(NamedTuple):
    """Images, camera and boxes of one stamp, as they were added.

    `depth` is aligned to `color`. `boxes2d` are the 2D boxes (x1, y1, x2, y2), and `boxes3d` those estimated from them,
    of which some may be missing. Boxes that have not arrived are None. `up` is as of `session_reader.Measurement`.
    """

    stamp_ns: int
    color: ColorImage
    depth: DepthImage
    camera: Camera
    boxes2d: Optional[Tuple[Tuple[int, int, int, int], ...]]
    boxes3d: Optional[Tuple[Box3D, ...]]
    up: Optional[np.ndarray] = None


class Snapshots(object):
    """Combines messages of five topics, which may arrive in any order, to snapshots.

    `add_color`, `add_depth`, `add_camera`, `add_boxes2d` and `add_boxes3d` are called with stamp, arrival time and
    value. 2D boxes have the stamp of the colour image, and 3D boxes that of the depth image. Depth and camera
    are matched as in `StampSynchronizer`. If time jumps back, older messages are dropped.

    Images are kept for `length_ns` until their boxes arrive. The stamps of colour and depth image differ by at most
    `tolerance_ns`. `on_lost` is called with the stamp of a colour image whose depth image or camera did not arrive.
    """

    def __init__(self, length_ns, tolerance_ns, on_lost):
        self._length_ns = length_ns
        self._sync = StampSynchronizer(length_ns, tolerance_ns, 0, self._on_frame, self._on_lost_color)
        self._on_lost = on_lost
        self._images, self._boxes2d, self._boxes3d = (MessageCache(length_ns) for _part in range(3))
        self.add_color, self.add_depth, self.add_camera = (
            self._sync.add_boxes, self._sync.add_depth, self._sync.add_camera)
        self.add_boxes2d, self.add_boxes3d = self._boxes2d.add, self._boxes3d.add
        self._first_ns = None

    @property
    def newest(self):
        """Newest snapshot that is complete, or else the most complete one; None before the first image."""
        snapshots = [Snapshot(stamp_ns, *images, _value_at(self._boxes2d, stamp_ns),
                              _value_at(self._boxes3d, depth_stamp_ns))
                     for stamp_ns, _arrival_ns, (depth_stamp_ns, *images) in reversed(self._images)]
        return max(snapshots, default=None,
                   key=lambda snapshot: (snapshot.boxes2d is not None) + (snapshot.boxes3d is not None))

    @property
    def is_early(self):
        """Whether boxes may be missing because images have been arriving for less than `length_ns`."""
        return self._first_ns is None or self._images.newest_ns - self._first_ns < self._length_ns

    def _on_frame(self, color, depth, camera):
        images = depth.stamp_ns, color.value, depth.value, camera
        went_back = self._images.add(color.stamp_ns, color.arrival_ns, images)
        if went_back:
            self._boxes2d.clear()
            self._boxes3d.clear()
        if went_back or self._first_ns is None:
            self._first_ns = color.stamp_ns

    def _on_lost_color(self, _color, stamp_ns, of_time_before):
        if not of_time_before:
            self._on_lost(stamp_ns)


def _value_at(cache, stamp_ns):
    entry = cache.nearest(stamp_ns)
    return None if entry is None else entry.value
