"""3D boxes from the depth layers of the objects in all rectangles of an image; see `box3d` for the conventions.

Depth layers are layers of z in the level frame, because people stand upright there.
"""
import numpy as np

from ros_3d_bb.estimation.box3d import (Box3D, complete_truncated_extent, slopes_down, truncated_edges,
                                        without_distortion)
from ros_3d_bb.estimation.depth_layers import BODY_HALF_DEPTH_MM, SortedDistances
from ros_3d_bb.estimation.depth_samples import GRID_COLUMNS, GRID_ROWS, RectSamples
from ros_3d_bb.estimation.overlaps import Overlaps

LEAST_MEASURED = 0.02  # minimum share of the samples with depth for an estimate; a lidar gives twice as many
LEAST_SUPPORT = 0.1  # minimum share of the samples with depth in the person's layer for an estimate
LEAST_WIDTH_M = 0.05
FILLED = 0.4  # minimum share of both sides of a rectangle that background behind an object fills


def estimate_foreground(depth, rects_px, geometry, kinds):
    """Estimate a box from the depth layer of the object in each rectangle of an image: the nearest layer that is
    dominant near the middle of the rectangle.

    Background beside and between the limbs may fill most of a rectangle, but it is farther away. Flying pixels are too
    sparse to form a layer. The position is that of the vertical axis of the object: laterally halfway between the edges
    of the layer, and behind its mean depth by the distance of its class. If the image border truncates the object, it
    is completed to the usual size of its class. All of this is done in the level frame.

    In the rectangles of nearer objects with plausible boxes, pixels that are not behind them are masked. Rectangles are
    therefore estimated in groups, each after those in front of it. Of several rectangles of one object, only the
    largest gets a box: what remains in the others is background, which continues beyond their left and right sides.

    Parameters
    ----------
    depth : depth_image.DepthImage
    rects_px : sequence of (x1, y1, x2, y2)
    geometry : ImageGeometry
    kinds : sequence of object_classes.ObjectClass
        That of each rectangle.

    Returns
    -------
    list of Box3D or None
        None if less than `LEAST_MEASURED` of the samples have a valid depth and a viewing ray, if the layer contains
        less than `LEAST_SUPPORT` of those with depth, if the rectangle cannot be undistorted, or if it is a second one
        of the same object.
    """
    image = _Image(depth, rects_px, geometry, kinds)
    boxes = [None] * len(rects_px)
    while image.overlaps.pending.any():
        for number, box in image.estimates(image.overlaps.take_foremost()):
            boxes[number] = box
    return boxes


class _Image(object):
    """Samples of all rectangles of an image, and the boxes estimated from them; see `estimate_foreground`."""

    def __init__(self, depth, rects_px, geometry, kinds):
        self._rects_px, self._kinds = list(map(tuple, rects_px)), kinds
        self._camera_from_level = geometry.level_from_camera.T
        rects_px = np.array(rects_px, np.int64)
        flat_px = without_distortion(rects_px, geometry.camera)
        self._slopes_down = slopes_down(flat_px, geometry)
        self._truncated = [truncated_edges(rect_px, geometry.area_px) for rect_px in self._rects_px]
        self._samples = samples = RectSamples(depth, rects_px, geometry)
        usable = samples.measured >= np.maximum(LEAST_MEASURED * samples.counts.prod(axis=1), 1)
        usable &= np.isfinite(flat_px).all(axis=1)
        self.overlaps = Overlaps(samples, usable, geometry.camera, kinds, self._truncated)

    def estimates(self, group):
        """Pairs (number, Box3D) of the rectangles in `group` (k,) that have a box; what these occlude is masked."""
        ahead_mm = self._samples.ahead_mm[group]
        ordered = SortedDistances(ahead_mm)
        layers_mm = self._samples.layers(group, ahead_mm, ordered)
        first, end = ordered.within(layers_mm, BODY_HALF_DEPTH_MM)
        supports = (end - first) / self._samples.measured[group]
        # The mean without the nearest and the farthest tenth is finer than the median, which has the depth resolution.
        tenth = (end - first) // 10
        layers_m = ordered.means(first + tenth, end - tenth) / 1000
        nearest_mm, farthest_mm = (ordered.at(rank).astype(np.uint16)[:, None] for rank in (first, end - 1))
        top_m, bottom_m = layers_m * self._slopes_down[:, group]
        on_body = (ahead_mm >= nearest_mm) & (ahead_mm <= farthest_mm)
        left_m, right_m = self._samples.edges(group, on_body, bottom_m)
        valid = (supports >= LEAST_SUPPORT) & ~(self.overlaps.repeats[group] & self._fills_sides(group, on_body))
        values = zip(valid.tolist(), group.tolist(), supports.tolist(), layers_m.tolist(), left_m.tolist(),
                     right_m.tolist(), top_m.tolist(), bottom_m.tolist())
        return [(number, self._box(number, support, *extents_m)) for is_valid, number, support, *extents_m in values
                if is_valid]

    def _fills_sides(self, group, on_body):
        """Whether the samples (k, samples) `on_body` fill at least `FILLED` of both sides of rectangles."""
        on_body, members = on_body.reshape(-1, GRID_ROWS, GRID_COLUMNS), np.arange(len(group))
        rows, columns = self._samples.counts[group].T
        return np.all([np.count_nonzero(on_body[members, :, column], axis=1) >= FILLED * rows
                       for column in (0, columns - 1)], axis=0)

    def _box(self, number, support, layer_m, left_m, right_m, top_m, bottom_m):
        rect_px, kind = self._rects_px[number], self._kinds[number]
        cut_left, cut_top, cut_right, cut_bottom = cut = self._truncated[number]
        left_m, right_m = complete_truncated_extent(left_m, right_m, cut_left, cut_right, kind.width)
        top_m, bottom_m = complete_truncated_extent(top_m, bottom_m, cut_top, cut_bottom, kind.height)
        surface_m = np.array([(left_m + right_m) / 2, (top_m + bottom_m) / 2, layer_m])
        width_m = max(right_m - left_m, LEAST_WIDTH_M)
        behind_m = kind.axis_behind(width_m)
        center_m = self._camera_from_level.dot(surface_m * (1 + behind_m / layer_m))
        box = Box3D(center_m, np.array([width_m, bottom_m - top_m, width_m]), rect_px, support, cut)
        if box.is_plausible:
            self.overlaps.mask_behind(number, int(1000 * (layer_m + behind_m)) + BODY_HALF_DEPTH_MM)
        return box
