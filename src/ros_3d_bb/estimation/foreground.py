"""3D boxes from the depth layers of the objects in all rectangles of an image; see `box3d` for the conventions.

The order of the objects and their masks are in `overlaps`, the layers in `depth_samples`.
"""
import math
from typing import NamedTuple

import numpy as np

from ros_3d_bb.core.object_classes import PERSON
from ros_3d_bb.estimation.box3d import (Box3D, complete_truncated_extent, slopes_down, truncated_edges,
                                        without_distortion)
from ros_3d_bb.estimation.depth_samples import (BESIDE_TRUNK_M, BODY_HALF_DEPTH_MM, FEET_M, LEAST_SIZE, LOOKS_DOWN,
                                                RectSamples, camera_rays)
from ros_3d_bb.estimation.overlaps import Overlaps

LEAST_MEASURED = 0.02  # minimum share of the samples with depth for an estimate; chosen: a lidar gives twice as many
# Minimum share of the weight of all samples in the layer for an estimate. Chosen: what a depth camera measures beside a
# person who is too near for it has at most 0.014 in the approach scenes.
LEAST_SHARE = 0.02
FEW = 0.2  # share of the samples from which on a layer has more than `LEAST_SHARE` of the weight, wherever it is
LEAST_SUPPORT = 0.1  # minimum share of the samples with depth in the layer for an estimate; chosen
TALL_M, ARMS_ABOVE_M = 1.8, 0.04  # chosen: people who appear taller may raise their arms so far above their heads
LEAST_WIDTH_M = 0.05  # chosen: of a body that is one pixel wide
BENT_M = 0.15  # chosen: before a level camera, the ends of people who walk are at most this far from their layer


def estimate_foreground(depth, rects_px, geometry, kinds):
    """Estimate a box from the depth layer of the object in each rectangle of an image: the nearest layer that is
    dominant near the middle of the rectangle. Furniture in front of a person, or what the person carries, is lower than
    people are, and does not reach the upper edge: what does is the person.

    Background beside and between the limbs may fill most of a rectangle, but it is farther away. Around a person it
    fills the outline of the rectangle, too, as furniture and other people at the sides do. Flying pixels are too sparse
    to form a layer. The position is that of the vertical axis of the object: laterally halfway between the edges of the
    layer, for people near the middle of the trunk, and behind its mean depth by the distance of its class. The ends of
    a person who bends are at their own distances: the head is nearer than the feet, or farther. The height of people
    does not include raised arms. If the image border truncates the object, it is completed to the usual size of its
    class. All of this is done in the level frame.

    In the rectangles of nearer objects with plausible boxes, pixels that are not behind them are masked. Rectangles are
    therefore estimated in groups, each after those in front of it. Of several rectangles of one object, only the
    largest gets a box: what remains in the others is background, which continues beyond their left and right sides.

    `depth` is a DepthImage, `geometry` its ImageGeometry, and `kinds` are the ObjectClasses of the rectangles.

    Returns
    -------
    list of Box3D or None
        None if less than `LEAST_MEASURED` of the samples have a valid depth and a viewing ray, if the layer contains
        less than `LEAST_SUPPORT` of those with depth, or less than `LEAST_SHARE` of all, weighted, if the rectangle
        cannot be undistorted, or if it is a second one of the same object.
    """
    rects_px = list(map(tuple, rects_px))
    flat_px = without_distortion(rects_px, geometry.camera)
    rays = camera_rays(geometry.camera)
    samples, truncated, usable, boxes = [], [], [], [None] * len(rects_px)
    with np.errstate(invalid='ignore'):  # nan: the distortion model has no ray for every pixel
        for number, rect_px in enumerate(rects_px):
            truncated.append(truncated_edges(rect_px, geometry.area_px))
            surrounded = _surrounded(kinds[number], truncated[number])
            least_m = _least_height(kinds[number], truncated[number])
            samples.append(RectSamples(depth, rect_px, rays, geometry.level_axes, surrounded, least_m))
            rows, columns = samples[number].shape
            has_depth = samples[number].measured >= max(LEAST_MEASURED * rows * columns, 1)
            if has_depth and math.isfinite(sum(flat_px[number])):
                usable.append(number)
    overlaps = Overlaps(samples, usable, geometry.camera, kinds, truncated)
    while overlaps.pending:
        for number in overlaps.take_foremost():
            seen = _visible_extents(samples[number], flat_px[number], geometry, number in overlaps.repeats)
            if seen is None:
                continue
            box, axis_m = _box(seen, rects_px[number], truncated[number], kinds[number], geometry)
            if box.is_plausible:
                overlaps.mask_behind(number, int(1000 * axis_m) + BODY_HALF_DEPTH_MM)
            boxes[number] = box
    return boxes


def _surrounded(kind, truncated):
    """Whether the left, the upper and the right edge of a rectangle show mainly what surrounds the object: not where
    the image border truncates it, and not those of an ObjectClass that may be as rectangular as a chair. Below people
    is the floor, or what hides their legs.
    """
    return tuple([kind.group == PERSON and not is_cut for is_cut in truncated[:3]])


def _least_height(kind, truncated):
    """Least height of people, metres; 0 if it is unknown, as of other objects, and where the left or the right image
    border truncates them, so that it is not known what surrounds them.
    """
    cut_left, _cut_top, cut_right, _cut_bottom = truncated
    return 0.0 if kind.group != PERSON or cut_left or cut_right else LEAST_SIZE * kind.height


class _Extents(NamedTuple):
    """Left, right, upper and lower end of what is visible of an object, the middle of its trunk, and its distance,
    metres; its support.
    """

    left_m: float
    right_m: float
    trunk_m: float
    top_m: float
    bottom_m: float
    layer_m: float
    support: float


def _visible_extents(samples, flat_px, geometry, may_repeat):
    """The _Extents of the object in a rectangle; None without an object of its own.

    `may_repeat` is whether it may be the background of another object.
    """
    layer = samples.layer()
    count = layer.end - layer.first
    support = count / samples.measured
    if support < LEAST_SUPPORT:
        return None
    on_body = samples.on_body(layer)
    if count < FEW * on_body.size and samples.share(on_body) < LEAST_SHARE:
        return None
    if may_repeat and samples.fill_sides(on_body):
        return None
    # The mean without the nearest and the farthest tenth is finer than the median, which has the depth resolution.
    layer_m = layer.mean_mm(layer.first + count // 10, layer.end - count // 10) / 1000
    upper, lower = slopes_down(flat_px, geometry)
    looks_down = geometry.level_axes[1][2] > LOOKS_DOWN
    # Before a level camera, the distances of the ends hardly matter unless the person bends; the mean is less noisy.
    upper_m, lower_m = [end_m if looks_down or abs(end_m - layer_m) > BENT_M else layer_m
                        for end_m in samples.ends(on_body)]
    top_m, bottom_m = upper_m * upper, lower_m * lower
    left_m, right_m, trunk_m = samples.edges(on_body, bottom_m - FEET_M if looks_down else None)
    if bottom_m - top_m > TALL_M:
        left_px, top_px, right_px, bottom_px = flat_px
        head_px = left_px, top_px + samples.pixels_above_head(on_body, trunk_m, layer_m), right_px, bottom_px
        head_m = layer_m * slopes_down(head_px, geometry)[0]
        top_m = head_m if head_m - top_m > ARMS_ABOVE_M else top_m
    return _Extents(left_m, right_m, trunk_m, top_m, bottom_m, layer_m, support)


def _box(seen, rect_px, truncated, kind, geometry):
    """The Box3D of an object, completed where the image border truncates it, and the distance of its axis, metres.

    `seen` are its _Extents, and `kind` is its ObjectClass.
    """
    left_m, right_m, trunk_m, top_m, bottom_m, layer_m, support = seen
    cut_left, cut_top, cut_right, cut_bottom = truncated
    left_m, right_m = complete_truncated_extent(left_m, right_m, cut_left, cut_right, kind.width)
    top_m, bottom_m = complete_truncated_extent(top_m, bottom_m, cut_top, cut_bottom, kind.height)
    middle_m = (left_m + right_m) / 2
    if kind.group == PERSON and (left_m, right_m) == seen[:2]:
        middle_m = min(max(middle_m, trunk_m - BESIDE_TRUNK_M), trunk_m + BESIDE_TRUNK_M)
    width_m = max(right_m - left_m, LEAST_WIDTH_M)
    axis_m = layer_m + kind.axis_behind(width_m)
    along_ray = axis_m / layer_m
    across_m, down_m = middle_m * along_ray, (top_m + bottom_m) / 2
    center_m = [x * across_m + y * down_m + z * axis_m for x, y, z in zip(*geometry.level_axes)]
    size_m = np.array((width_m, bottom_m - top_m, width_m))
    return Box3D(np.array(center_m), size_m, rect_px, support, truncated, largest_m=kind.largest_m), axis_m
