"""3D box estimators: from rectangles in the depth image to 3D boxes. See `box3d` for the conventions.

Of the estimator foreground, the order of the objects and their masks are in `overlaps`, the layers in `depth_samples`.
"""
import functools
import math
from typing import Any, NamedTuple

import numpy as np

from ros_3d_bb.camera.images import FARTHEST_M
from ros_3d_bb.core.object_classes import PERSON, ObjectClasses
from ros_3d_bb.estimation.box3d import (HIDDEN, LEVEL, NO_DEPTH, NO_LAYER, NO_RAY, REPEATED, UNKNOWN, Box3D,
                                        ImageGeometry, Rejected, truncated_edges, without_distortion)
from ros_3d_bb.estimation.depth_samples import BODY_HALF_DEPTH_MM, RectSamples, grid_in, level_rays
from ros_3d_bb.estimation.median import centred_grid, estimate_median
from ros_3d_bb.estimation.overlaps import Overlaps

# A camera with more tilt or roll does not show people upright; chosen.
MAX_TILT_RAD, MAX_ROLL_RAD = np.radians(65), np.radians(45)
LEAST_MEASURED = 0.02  # minimum share of the samples with depth for an estimate; chosen: a lidar gives twice as many
# Minimum share of the weight of all samples in the layer for an estimate. Chosen: what a depth camera measures beside a
# person who is too near for it has at most 0.014 in the approach scenes.
LEAST_SHARE = 0.02
LEAST_SUPPORT = 0.1  # minimum share of the samples with depth in the layer for an estimate; chosen
# Share of the difference to the usual width that the image border hides on average: people seen from the side are
# narrower. Measured by ./run bench accuracy: RMSE 0.038 m, with all of it 0.047 m.
MISSING_SHARE = 2 / 3
LEAST_WIDTH_M = 0.05  # chosen: of a body that is one pixel wide
ARM_GAP_M = 0.15  # chosen: between an arm and the trunk
LEAST_AHEAD = 0.05  # lower bound of the horizontal part of a ray; chosen


class Samples(NamedTuple):
    """Grid of depth samples in one rectangle: columns (w,), rows (h,), depth_m (h, w), metres, and valid (h, w),
    whether depth was measured.
    """

    columns: np.ndarray
    rows: np.ndarray
    depth_m: np.ndarray
    valid: np.ndarray

    @property
    def pixels(self):
        """Pixel coordinates (u, v) of the grid, (h, w, 2)."""
        return np.stack(np.meshgrid(self.columns, self.rows), axis=-1)


def sample_depth(depth, rect_px, grid):
    """Samples of a DepthImage in a rectangle, at the rows and columns (slices) of `grid(rect_px, shape)`."""
    height, width = depth.shape
    rows, columns = grid(tuple(map(int, rect_px)), (height, width))
    depth_m = depth.part(rows, columns).astype(float) * depth.scale_m
    with np.errstate(invalid='ignore'):  # nan
        valid = (depth_m > 0) & (depth_m <= FARTHEST_M)
    return Samples(np.arange(width)[columns], np.arange(height)[rows], depth_m, valid)


class Estimator(NamedTuple):
    """Pair of functions: `sample(depth, rect_px)` returns the Samples in a rectangle, and `estimate(depth, rects_px,
    geometry, kinds)` the Box3D or Rejected of each rectangle, whose ObjectClass in `kinds` is that of `classes`.
    """

    sample: Any
    estimate: Any
    classes: ObjectClasses = ObjectClasses()


def estimator_named(name, stride_px=20, classes=ObjectClasses()):
    """Create the estimator foreground or median; `stride_px` is the grid spacing of the estimator median, `classes` the
    table of the classes of objects.

    Raises ValueError if the name is unknown or the stride is not positive.
    """
    if stride_px < 1:
        raise ValueError('stride is %d; at least 1 expected' % stride_px)
    if name == 'foreground':
        return Estimator(functools.partial(sample_depth, grid=grid_in), estimate_foreground, classes)
    if name == 'median':
        sample = functools.partial(sample_depth, grid=functools.partial(centred_grid, stride_px=stride_px))

        def estimate(depth, rects_px, geometry, _kinds):
            return [estimate_median(sample(depth, rect_px), rect_px, geometry) for rect_px in rects_px]
        return Estimator(sample, estimate, classes)
    raise ValueError('estimator is %r; foreground or median expected' % name)


def estimate_boxes(depth, rects_px, camera, estimator, level_from_camera=LEVEL, labels=None):
    """Estimate the 3D boxes of all rectangles of one image.

    Parameters
    ----------
    depth : images.DepthImage
    rects_px : list of (x1, y1, x2, y2)
    camera : camera_model.Camera
    estimator : Estimator
    level_from_camera : numpy.ndarray, (3, 3), optional
        Rotation to the level frame, see `level_rotation`. By default the camera is held level.
    labels : sequence of str, optional
        Class names of the rectangles, also as in other data sets (`ObjectClasses.standard_name`). By default they are
        those of people.

    Returns
    -------
    list of Box3D or Rejected
        In the order of the rectangles; Rejected without an estimate. Not all boxes are plausible, see
        `Box3D.is_plausible`.
    """
    if len(rects_px) == 0:  # most images show no people
        return []
    labels = list(map(estimator.classes.standard_name, labels or [PERSON] * len(rects_px)))
    geometry = ImageGeometry(camera, depth.measured_area(), tuple(map(tuple, level_from_camera.tolist())))
    boxes = estimator.estimate(depth, rects_px, geometry, list(map(estimator.classes.of, labels)))
    for number, label in enumerate(labels):
        if isinstance(boxes[number], Box3D) and label != boxes[number].label:
            boxes[number] = boxes[number]._replace(label=label)
    return boxes


def level_rotation(up):
    """Rotation (3, 3) from the optical frame to the level frame, given the unit vector `up` (3,) in the optical frame.

    It is `LEVEL` if `up` is None, unknown, or the camera points so steeply up or down, or is rolled so far, that people
    do not stand upright in the image (`MAX_TILT_RAD`, `MAX_ROLL_RAD`).
    """
    if up is None:
        return LEVEL
    down = -np.asarray(up, float)
    if abs(down[2]) > np.sin(MAX_TILT_RAD) or down[1] < np.cos(MAX_ROLL_RAD) * np.hypot(down[0], down[1]):
        return LEVEL
    ahead = np.array([0.0, 0.0, 1.0]) - down[2] * down
    ahead /= np.linalg.norm(ahead)
    return np.stack((np.cross(down, ahead), down, ahead))


def estimate_foreground(depth, rects_px, geometry, kinds):
    """Estimate a box from the depth layer of the object in each rectangle of an image: the nearest layer that is
    dominant in the rectangle, above all in its upper part: furniture in front of a person is lower than people are.

    Background beside and between the limbs may fill most of a rectangle, but it is farther away. Around a person it
    fills the outline of the rectangle, too, as furniture and other people at the sides do. Flying pixels are too sparse
    to form a layer. The position is that of the vertical axis of the object: laterally halfway between the edges of the
    layer, for people at their median, and behind its mean depth by the distance of its class. The ends of
    a person who bends are at their own distances: the head is nearer than the feet, or farther. The height of people
    includes raised arms. If the image border truncates the object, it is completed towards the usual size of its
    class. All of this is done in the level frame.

    Samples of a person whose head is above the image are those in a wider rectangle (`_widened`).

    In the rectangles of nearer objects with plausible boxes, pixels that are not behind them are masked. Rectangles are
    therefore estimated in groups, each after those in front of it. Of several rectangles of one object, only the
    foremost gets a box: what remains in the others is background, which continues beyond their left and right sides.

    `depth` is a DepthImage, `geometry` its ImageGeometry, and `kinds` are the ObjectClasses of the rectangles.

    Returns
    -------
    list of Box3D or Rejected
        Rejected if less than `LEAST_MEASURED` of the samples have a valid depth and a viewing ray (`NO_DEPTH`), if the
        layer contains less than `LEAST_SUPPORT` of those with depth, or less than `LEAST_SHARE` of all, weighted
        (`NO_LAYER`), if the rectangle cannot be undistorted (`NO_RAY`), if all samples are masked (`HIDDEN`), or if it
        is a second one of the same object (`REPEATED`).
    """
    rects_px = list(map(tuple, rects_px))
    rays = level_rays(geometry.camera, geometry.level_axes)
    samples, whole_px, truncated, usable = [], [], [], []
    hidden = Rejected(HIDDEN)
    boxes = [hidden] * len(rects_px)
    for rect_px, kind in zip(rects_px, kinds):
        edges = truncated_edges(rect_px, geometry.area_px)
        of_rect = RectSamples(depth, rect_px, rays, _surrounded(kind, edges))
        if kind.group == PERSON and edges[1]:
            wider_px = _widened(of_rect, depth, kind, rays, geometry)
            if wider_px != rect_px:
                edges = truncated_edges(wider_px, geometry.area_px)
                of_rect = RectSamples(depth, wider_px, rays, _surrounded(kind, edges))
        samples.append(of_rect)
        whole_px.append(of_rect.rect_px)
        truncated.append(edges)
    flat_px = without_distortion(whole_px, geometry.camera)
    for number, each in enumerate(samples):
        rows, columns = each.shape
        if not math.isfinite(sum(flat_px[number])):
            boxes[number] = Rejected(NO_RAY)
        elif each.measured < max(LEAST_MEASURED * rows * columns, 1):
            boxes[number] = Rejected(NO_DEPTH)
        else:
            usable.append(number)
    overlaps = Overlaps(rects_px, samples, usable, geometry.camera, kinds, truncated)
    while overlaps.pending:
        for number in overlaps.take_foremost():
            seen = _visible_extents(samples[number], flat_px[number], geometry, number in overlaps.repeats)
            if isinstance(seen, Rejected):
                boxes[number] = seen
                continue
            box, axis_m = _box(seen, rects_px[number], truncated[number], kinds[number], geometry)
            if box.is_plausible:
                overlaps.mask_behind(number, int(1000 * axis_m) + BODY_HALF_DEPTH_MM)
            boxes[number] = box
    for number in overlaps.repeats:
        if boxes[number] is hidden:
            boxes[number] = Rejected(REPEATED)
    return boxes


def _widened(samples, depth, kind, rays, geometry):
    """The rectangle of the samples of a person, wider where the body continues beside it, up to the usual width.

    Of people who are so near that their heads are above the image, detectors often find an arm or half of the trunk.
    """
    layer, (left, top, right, bottom) = samples.layer(), samples.rect_px
    if not layer:
        return samples.rect_px
    pixels_per_m = geometry.camera.fx / (layer.trunk_mm / 1000)
    missing_px = int(kind.width * pixels_per_m) - (right - left)
    if missing_px <= 0:
        return samples.rect_px
    area_left, _top, area_right, _bottom = geometry.area_px
    around_px = max(left - missing_px, area_left), top, min(right + missing_px, area_right), bottom
    around = RectSamples(depth, around_px, rays, (False, False, False))
    from_px, to_px = around.columns_of(layer, left, right, int(ARM_GAP_M * pixels_per_m))
    share = min(missing_px / max(left - from_px + to_px - right, 1), 1)
    return left - int(share * (left - from_px)), top, right + int(share * (to_px - right)), bottom


def _surrounded(kind, truncated):
    """Whether the left, upper and right edge of the rectangle of an ObjectClass show mainly what surrounds the object.

    Below people is the floor, or what hides their legs. Other objects may be as rectangular as a chair. Where the image
    border truncates a person, an edge shows the person.
    """
    return tuple(kind.group == PERSON and not is_cut for is_cut in truncated[:3])


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
    """The _Extents of the object in a rectangle; Rejected without an object of its own.

    `may_repeat` is whether it may be the background of another object.
    """
    layer = samples.layer()
    count = layer.end - layer.first
    support = count / samples.measured
    if support < LEAST_SUPPORT:
        return Rejected(NO_LAYER)
    on_body = samples.on_body(layer)
    if samples.share(on_body) < LEAST_SHARE:
        return Rejected(NO_LAYER)
    if count < on_body.size - samples.measured and samples.surround_unknown(on_body):
        return Rejected(UNKNOWN)
    if may_repeat and samples.fill_sides(on_body):
        return Rejected(REPEATED)
    # The mean without the nearest and the farthest tenth is finer than the median, which has the depth resolution.
    inner_mm = layer.ordered_mm[layer.first + count // 10:layer.end - count // 10]
    layer_m = int(inner_mm.sum()) / (1000 * len(inner_mm))
    upper_m, lower_m = samples.ends(on_body)
    left_px, top_px, right_px, bottom_px = flat_px
    middle_px = (left_px + right_px) / 2.0
    top_m = upper_m * slope_down(middle_px, top_px, geometry)
    bottom_m = lower_m * slope_down(middle_px, bottom_px, geometry)
    left_m, right_m, trunk_m = samples.edges(on_body)
    return _Extents(left_m, right_m, trunk_m, top_m, bottom_m, layer_m, support)


def _box(seen, rect_px, truncated, kind, geometry):
    """The Box3D of an object, completed where the image border truncates it, and the distance of its axis, metres.

    `seen` are its _Extents, and `kind` is its ObjectClass.
    """
    left_m, right_m, trunk_m, top_m, bottom_m, layer_m, support = seen
    cut_left, cut_top, cut_right, cut_bottom = truncated
    usual_m = (1 - MISSING_SHARE) * (right_m - left_m) + MISSING_SHARE * kind.width
    left_m, right_m = complete_truncated_extent(left_m, right_m, cut_left, cut_right, usual_m)
    top_m, bottom_m = complete_truncated_extent(top_m, bottom_m, cut_top, cut_bottom, kind.height)
    is_whole_person = kind.group == PERSON and (left_m, right_m) == seen[:2]
    middle_m = trunk_m if is_whole_person else (left_m + right_m) / 2
    width_m = max(right_m - left_m, LEAST_WIDTH_M)
    axis_m = layer_m + kind.axis_behind(width_m)
    along_ray = axis_m / layer_m
    across_m, down_m = middle_m * along_ray, (top_m + bottom_m) / 2
    center_m = [x * across_m + y * down_m + z * axis_m for x, y, z in zip(*geometry.level_axes)]
    size_m = np.array((width_m, bottom_m - top_m, width_m))
    return Box3D(np.array(center_m), size_m, rect_px, support, truncated, largest_m=kind.largest_m), axis_m


def complete_truncated_extent(low, high, cut_low, cut_high, usual):
    """Extend low..high of a body that the image border truncates at one end to at least the usual extent."""
    missing = max(0.0, usual - (high - low))
    if cut_low and not cut_high:
        return low - missing, high
    return low, high + (missing if cut_high and not cut_low else 0.0)


def slope_down(u, v, geometry):
    """y / z in the level frame of the ray through an undistorted position (u, v), pixels."""
    camera = geometry.camera
    _across, (down_x, down_y, down_z), (ahead_x, ahead_y, ahead_z) = geometry.level_axes
    x, y = (u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy
    return (down_x * x + down_y * y + down_z) / max(ahead_x * x + ahead_y * y + ahead_z, LEAST_AHEAD)
