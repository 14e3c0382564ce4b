"""The thesis' algorithms as chapter 3 describes their optimised version: what `bench speed` compares with.

Estimation, 3.4.2, one box after the other: "First, ranges of X and Y coordinates of pixels to be sampled were created.
Then, the combination of those were used to vectorize the sampling of depth information. Furthermore, the implementation
of a crucial function of the RealSense SDK was studied and its calculations were also vectorized using NumPy." Pixels
without depth are filtered out, "a median in each axis is taken", and the size is that of the box at the median depth.
The proof of concept with its loops over samples, 2.5 times slower by the thesis, is not what is meant here.

Tracking, 3.6: "The positions of objects in two consecutive frames are compared, pairs with smallest distances between
existing and a new detections are found, and, starting from the pair with the smallest distance, each existing detection
is updated with the corresponding new." An object that was not matched for a period is deleted; an exponential moving
average filters the velocity; "a linear prediction is made based on the current position of an object and its filtered
velocity". Objects are Python's, each updated by itself; distances are one array.

The answers are those of `estimation.estimate_median` and `tracking.thesis.ThesisTracker`, without what these add: no
support, no lens distortion, no boxes that leave the image, one prediction instead of many. Where two objects are
nearest to one box, the farther one stays unmatched here, as in the algorithm that the thesis took parts from.
"""
from typing import NamedTuple

import numpy as np

from ros_3d_bb.geometry import transform_points
from ros_3d_bb.stamped import NS
from ros_3d_bb.tracking.association import plane_distances

STRIDE_PX = 20
ALPHA, LIMIT_S, AHEAD_S = 0.2, 1.0, 2.0  # of the moving average; of disappearance; of the prediction


class ThesisBox(NamedTuple):
    """`center_m` (3,) and `size_m` (width, height, width) in the frame of the camera, metres."""

    center_m: np.ndarray
    size_m: tuple


def thesis_boxes(depth, rects_px, camera):
    """The boxes of rectangles that lie inside the image, in their order, without those that show no depth.

    Parameters
    ----------
    depth : estimation.DepthImage
    rects_px : list of (x1, y1, x2, y2)
    camera : geometry.Camera
        Without distortion.

    Returns
    -------
    list of ThesisBox
    """
    boxes = [_box(depth, rect_px, camera) for rect_px in rects_px]
    return [box for box in boxes if box is not None]


def _box(depth, rect_px, camera):
    x1, y1, x2, y2 = rect_px
    u, v = np.meshgrid(_ticks(x1, x2), _ticks(y1, y2))
    z_m = depth.values[v, u] * depth.scale_m
    points = np.stack(((u - camera.cx) / camera.fx * z_m, (v - camera.cy) / camera.fy * z_m, z_m), axis=-1)
    points = points[z_m > 0]
    if not len(points):
        return None
    center_m = np.median(points, axis=0)
    width_m, height_m = (x2 - x1) / camera.fx * center_m[2], (y2 - y1) / camera.fy * center_m[2]
    return ThesisBox(center_m, (width_m, height_m, width_m))


def _ticks(low, high):
    """Pixels `STRIDE_PX` apart, in the middle of low..high."""
    count = -(-(high - low) // STRIDE_PX)
    return np.arange(low + (high - low - (count - 1) * STRIDE_PX - 1) // 2, high, STRIDE_PX)


class _Object(object):
    def __init__(self, number, position_m, size_m, stamp_ns):
        self.number, self.velocity_mps = number, (0.0, 0.0)
        self.move(position_m, size_m, stamp_ns)

    def move(self, position_m, size_m, stamp_ns):
        """Go to where it was seen."""
        self.position_m, self.size_m, self.seen_ns = position_m, size_m, stamp_ns

    def filter_velocity(self, position_m, stamp_ns):
        """Average the velocity to a position where it was seen now."""
        elapsed_s = (stamp_ns - self.seen_ns) / NS
        self.velocity_mps = tuple(ALPHA * (new - old) / elapsed_s + (1 - ALPHA) * average for new, old, average
                                  in zip(position_m, self.position_m, self.velocity_mps))


class ThesisTracks(object):
    """Follows boxes from image to image; `objects` are those it knows."""

    def __init__(self):
        self.objects, self._last_number = [], 0

    def update(self, stamp_ns, boxes, fixed_from_camera):
        """Take the boxes of one image.

        Parameters
        ----------
        stamp_ns : int
        boxes : list of ThesisBox
        fixed_from_camera : numpy.ndarray, (4, 4)

        Returns
        -------
        dict
            By number: (x, y) in `AHEAD_S`, metres in the fixed frame.
        """
        positions_m = [tuple(transform_points(fixed_from_camera, box.center_m).tolist()) for box in boxes]
        matched = self._match(positions_m)
        for row, column in matched.items():
            self.objects[row].filter_velocity(positions_m[column], stamp_ns)
            self.objects[row].move(positions_m[column], boxes[column].size_m, stamp_ns)
        self.objects = [known for known in self.objects if stamp_ns - known.seen_ns <= LIMIT_S * NS]
        for column in sorted(set(range(len(boxes))) - set(matched.values())):
            self._last_number += 1
            self.objects.append(_Object(self._last_number, positions_m[column], boxes[column].size_m, stamp_ns))
        return {known.number: tuple(place_m + AHEAD_S * speed_mps for place_m, speed_mps
                                    in zip(known.position_m, known.velocity_mps)) for known in self.objects}

    def _match(self, positions_m):
        """Columns of positions by rows of objects: each object's nearest, where no nearer object took it before."""
        pairs = {}
        if self.objects and positions_m:
            distances_m = plane_distances([known.position_m for known in self.objects], positions_m)
            nearest, rows, taken = distances_m.argmin(axis=1), distances_m.min(axis=1).argsort(), set()
            for row, column in zip(rows.tolist(), nearest[rows].tolist()):
                if column not in taken:
                    pairs[row] = column
                    taken.add(column)
        return pairs
