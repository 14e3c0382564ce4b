"""The estimator foreground: the depth layer of the object in each rectangle. See `box3d` for the conventions.

The order and the masks of objects are in `overlaps`, layers in `depth_samples`, and the image border in `body`.
"""
import math
from typing import Dict, List, Optional, Sequence, Tuple, Union

import numpy as np

from ros_3d_bb.camera.images import DepthImage
from ros_3d_bb.core.object_classes import PERSON, ObjectClass
from ros_3d_bb.estimation.body import MISSING_SHARE, Extent, ObjectInRect, object_in
from ros_3d_bb.estimation.box3d import (HIDDEN, NO_DEPTH, NO_LAYER, NO_RAY, REPEATED, UNKNOWN, Box3D, Edges,
                                        ImageGeometry, Rect, Rejected, without_distortion)
from ros_3d_bb.estimation.depth_samples import BODY_HALF_DEPTH_MM, Layer, RectSamples
from ros_3d_bb.estimation.overlaps import Overlaps

# Minimum share of the samples with depth, and of the weight of all samples in the layer. Measured: beside a person who
# is too near for the depth camera, at most 0.014 (test_difficult_views.py); a lidar has depth in 0.04 of the samples.
LEAST_SHARE = 0.02
# Minimum share of the samples with depth in the layer: of depth that is spread over 1 to 9 m, a body has 0.09.
LEAST_SUPPORT = 0.1


def estimate_foreground(depth: DepthImage, rects_px: Sequence[Rect], geometry: ImageGeometry,
                        kinds: Sequence[ObjectClass]) -> List[Union[Box3D, Rejected]]:
    """Estimate a box from the depth layer of the object in each rectangle of an image: the nearest layer that is
    dominant in the rectangle, above all in its upper part, and does not fill its outline, as what is beside and behind
    people does. Flying pixels are too sparse to form a layer.

    The position is that of the vertical axis of the object, in the level frame: for people the median of the layer, for
    others the middle between its edges, and behind its mean depth by the distance of the class. The ends of a person
    who bends are at their own distances. The height includes raised arms.

    In the rectangles of nearer objects with plausible boxes, pixels that are not behind them are masked. Rectangles are
    therefore estimated in groups, each after those in front of it. Of several rectangles of one object, only the
    foremost gets a box: what remains in the others is background, which continues beyond their left and right sides.

    `kinds` are the ObjectClasses of the rectangles. For the reasons of rejection see `box3d.REASONS`.
    """
    objects = [object_in(depth, tuple(rect_px), kind, geometry) for rect_px, kind in zip(rects_px, kinds)]
    flat_px = without_distortion([each.samples.rect_px for each in objects], geometry.camera)
    reasons = [_without_estimate(each.samples, flat) for each, flat in zip(objects, flat_px)]
    boxes: Dict[int, Union[Box3D, Rejected]] = {}
    overlaps = Overlaps(objects, [number for number, reason in enumerate(reasons) if reason is None], geometry.camera)
    while overlaps.pending:
        for number in overlaps.take_foremost():
            box = _estimate(objects[number], flat_px[number], geometry, number in overlaps.repeats)
            if isinstance(box, Box3D) and box.is_plausible:
                axis_m = box.center_m.dot(geometry.level_axes[2])
                overlaps.mask_behind(number, int(1000 * axis_m) + BODY_HALF_DEPTH_MM)
            boxes[number] = box
    return [boxes.get(number) or Rejected(reason or (REPEATED if number in overlaps.repeats else HIDDEN))
            for number, reason in enumerate(reasons)]


def _without_estimate(samples: RectSamples, flat_px: Sequence[float]) -> Optional[str]:
    """Why there is no estimate in a rectangle, whatever is in front of it: one of `REASONS`, or None."""
    if not math.isfinite(sum(flat_px)):
        return NO_RAY
    rows, columns = samples.shape
    return NO_DEPTH if samples.measured < max(LEAST_SHARE * rows * columns, 1) else None


def _without_object(samples: RectSamples, layer: Layer, on_body: np.ndarray, may_repeat: bool) -> Optional[str]:
    """Why a Layer is not that of an object of its own: one of `REASONS`, or None. `may_repeat` is whether it may be the
    background of another object."""
    count = layer.end - layer.first
    if count < LEAST_SUPPORT * samples.measured or samples.share(on_body) < LEAST_SHARE:
        return NO_LAYER
    if count < on_body.size - samples.measured and samples.surround_unknown(on_body):
        return UNKNOWN
    return REPEATED if may_repeat and samples.fill_sides(on_body) else None


def _estimate(seen: ObjectInRect, flat_px: Sequence[float], geometry: ImageGeometry,
              may_repeat: bool) -> Union[Box3D, Rejected]:
    """The Box3D of the object in a rectangle, whose undistorted edges are `flat_px`."""
    samples, kind, edges = seen.samples, seen.kind, seen.edges
    layer = samples.layer()
    if layer is None:
        return Rejected(HIDDEN)
    on_body = samples.on_body(layer)
    reason = _without_object(samples, layer, on_body, may_repeat)
    if reason:
        return Rejected(reason)
    left_m, right_m, median_m = samples.edges(on_body)
    seen_across = Extent(left_m, right_m, edges.left, edges.right)
    across = seen_across.completed(kind.width, MISSING_SHARE)
    down = _extent_down(samples.ends(on_body), flat_px, edges, geometry).completed(kind.height)

    layer_m, pixel_m = layer.mean_m(), layer.trunk_mm / (1000 * geometry.camera.fx)
    width_m = max(across.size_m, pixel_m)
    axis_m = layer_m + kind.axis_behind(width_m)
    middle_m = median_m + across.middle_m - seen_across.middle_m if kind.group == PERSON else across.middle_m
    across_m = middle_m * axis_m / layer_m
    center_m = [x * across_m + y * down.middle_m + z * axis_m for x, y, z in zip(*geometry.level_axes)]
    return Box3D(np.array(center_m), np.array((width_m, down.size_m, width_m)), seen.rect_px,
                 (layer.end - layer.first) / samples.measured, edges, largest_m=kind.largest_m)


def _extent_down(ends_m: Tuple[float, float], flat_px: Sequence[float], edges: Edges,
                 geometry: ImageGeometry) -> Extent:
    """The Extent of an object down, given the distances of its upper and of its lower end, metres."""
    left_px, top_px, right_px, bottom_px = flat_px
    middle_px = (left_px + right_px) / 2.0
    top_m, bottom_m = (end_m * _slope_down(middle_px, end_px, geometry)
                       for end_m, end_px in zip(ends_m, (top_px, bottom_px)))
    return Extent(top_m, bottom_m, edges.top, edges.bottom)


def _slope_down(u: float, v: float, geometry: ImageGeometry) -> float:
    """y / z in the level frame of the ray through an undistorted position (u, v), pixels."""
    camera = geometry.camera
    _across, (down_x, down_y, down_z), (ahead_x, ahead_y, ahead_z) = geometry.level_axes
    x, y = (u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy
    ahead = ahead_x * x + ahead_y * y + ahead_z
    return (down_x * x + down_y * y + down_z) / max(ahead, 1e-6)  # a ray that does not point ahead: no plausible height
