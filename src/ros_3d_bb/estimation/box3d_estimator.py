"""3D box estimators: from a rectangle in the depth image to a 3D box.

Conventions: a rectangle (x1, y1, x2, y2) contains the pixels x1 <= u < x2, y1 <= v < y2. Positions are in the camera
optical frame, metres. The level frame of a camera has the same origin, x horizontally to the right, y down and z
horizontally ahead; `level_from_camera` (3, 3) rotates the optical frame to it. Depth layers are layers of z in the
level frame, because people stand upright there. In `sorted_depths_m` (nearest first), a layer is a slice and its median
an element.
"""
import functools
from typing import Any, NamedTuple, Optional, Tuple

import numpy as np

from ros_3d_bb.camera.camera_model import Camera
from ros_3d_bb.camera.depth_image import FARTHEST_M as FARTHEST_DEPTH_M
from ros_3d_bb.core.labels import PERSON
from ros_3d_bb.core.limits import FARTHEST_M, LARGEST_M
from ros_3d_bb.core.object_classes import PERSON_CLASS, ObjectClasses

# A box whose edge is this close to the image border, in pixels plus a share of its extent, counts as truncated:
# detectors regress the edge of a truncated person up to 8 pixels inside the image, farther for larger boxes. A person
# who is not truncated there loses little, because only boxes of less than the usual size are completed.
BORDER_PX, BORDER_SHARE = 4, 0.02
# Nearer people stand lower in the image. The lower edges of truncated boxes are compared at this height.
CUT_ROWS = 1 / 30.0  # share of the image height
SAMPLES_WANTED = 2000  # approximate number of pixels that the foreground estimator samples
LEAST_MEASURED = 0.02  # minimum share of the samples with depth for an estimate; a lidar gives twice as many
LEAST_SUPPORT = 0.1  # minimum share of the samples with depth in the person's layer for an estimate
LEAST_WIDTH_M = 0.05
LEVEL = np.eye(3)  # of a camera that is held level
MAX_TILT_RAD, MAX_ROLL_RAD = np.radians(65), np.radians(45)
LEAST_AHEAD = 0.05  # lower bound of the horizontal part of a ray
LOOKS_DOWN, FEET_M = np.sin(np.radians(10)), 0.3  # a camera with more tilt sees the floor beside the feet, this high

# Half the depth extent of a person with stretched arms; points farther from the median are not part of the person.
BODY_HALF_DEPTH_M = 0.35
TRUNK_HALF_DEPTH_M = 0.25  # without arms and legs: a wall close behind must not shift the median
BIN_M, LAYER_BINS = 0.05, 5  # bin width of the depth histogram, and thickness of a layer in bins
MEDIANS = 3  # maximum number of iterations of the median of the trunk
FIRST_LAYER_SHARE = 0.5  # the nearest layer with at least this share of the largest layer weight is the person
EDGE_PERCENT = 5  # percentage of the layer's pixels ignored at the left and at the right: arms, flying pixels


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


class ImageGeometry(NamedTuple):
    """Geometry of one image: its camera, the part of it with depth (see `DepthImage.measured_area`), and the rotation
    (3, 3) from the optical frame to the level frame (see `level_rotation`).
    """

    camera: Camera
    area_px: Tuple[int, int, int, int]
    level_from_camera: np.ndarray = LEVEL


class Box3D(NamedTuple):
    """An upright cylinder, with quality measures.

    `center_m` (3,) in the camera optical frame and `size_m` (width, height, width) are in metres; `rect_px` is the
    source rectangle; `support` is the share 0..1 of the samples with depth that belong to its depth layer;
    `truncated_edges` states whether the left, upper, right and lower edge of the rectangle touch the image border;
    `covariance_m2` (3, 3) is that of the centre, None if unknown; `label` is the class name, and `score` is that of the
    rectangle, 0..1, 0 if unknown.
    """

    center_m: np.ndarray
    size_m: np.ndarray
    rect_px: Tuple[int, int, int, int]
    support: float
    truncated_edges: Tuple[bool, bool, bool, bool]
    covariance_m2: Optional[Any] = None
    label: str = PERSON
    score: float = 0.0

    @property
    def truncated(self):
        """Whether the image border truncates the object."""
        return any(self.truncated_edges)

    @property
    def is_plausible(self):
        """Whether the centre is nearer than `FARTHEST_M`, and width and height are between 0 and `LARGEST_M`."""
        x_m, y_m, z_m = np.abs(self.center_m).tolist()
        width_m, height_m, _width_m = self.size_m.tolist()
        return (x_m < FARTHEST_M and y_m < FARTHEST_M and z_m < FARTHEST_M
                and 0 < width_m < LARGEST_M and 0 < height_m < LARGEST_M)


def sample_depth(depth, rect_px, stride_px=None):
    """Sample a rectangle on a centred grid of every `stride_px` pixels, clipped to the image (thesis 3.4.2).

    Parameters
    ----------
    depth : depth_image.DepthImage
    rect_px : (x1, y1, x2, y2)
        There are no samples in an empty or reversed rectangle.
    stride_px : int, optional
        Default: a stride that gives about `SAMPLES_WANTED` samples in rectangles of any size.

    Returns
    -------
    Samples
    """
    height, width = depth.shape
    x1, y1, x2, y2 = map(int, rect_px)
    if stride_px is None:
        visible_columns = min(max(x2, 0), width) - min(max(x1, 0), width)
        visible_rows = min(max(y2, 0), height) - min(max(y1, 0), height)
        visible_px = max(0, visible_columns) * max(0, visible_rows)
        stride_px = max(1, int(np.sqrt(visible_px / SAMPLES_WANTED)))
    columns, rows = _ticks(x1, x2, width, stride_px), _ticks(y1, y2, height, stride_px)
    depth_m = depth.part(rows, columns).astype(float) * depth.scale_m
    valid = (depth_m > 0) & (depth_m <= FARTHEST_DEPTH_M)
    return Samples(np.arange(width)[columns], np.arange(height)[rows], depth_m, valid)


def estimate_median(samples, rect_px, geometry, _nearer=(), _kind=PERSON_CLASS):
    """Estimate a box as in the thesis (3.4.2): per-axis median of the sampled points, size from the box at that depth.

    Parameters and return value are those of `estimate_foreground`; nearer boxes, the class and the tilt of the camera
    are ignored, and there is no minimum support.
    """
    camera = geometry.camera
    across, down = camera.rays(samples.columns, samples.rows[:, np.newaxis])
    seen = samples.valid & ~np.isnan(across)  # the distortion model does not define a ray for every pixel
    flat_px = _without_distortion(rect_px, camera)
    if flat_px is None or not seen.any():
        return None
    points = np.stack((across * samples.depth_m, down * samples.depth_m, samples.depth_m), axis=-1)[seen]
    x1, y1, x2, y2 = flat_px
    center_m = np.median(points, axis=0)
    width_m, height_m = (x2 - x1) / camera.fx * center_m[2], (y2 - y1) / camera.fy * center_m[2]
    on_body = np.abs(samples.depth_m[samples.valid] - center_m[2]) <= BODY_HALF_DEPTH_M
    return Box3D(center_m, np.array([width_m, height_m, width_m]), tuple(rect_px), on_body.mean(),
                 truncated_edges(rect_px, geometry.area_px))


def estimate_foreground(samples, rect_px, geometry, nearer=(), kind=PERSON_CLASS):
    """Estimate a box from the object's depth layer: the nearest layer that is dominant near the middle of the box.

    Background beside and between the limbs may fill most of a box, but it is farther away. Flying pixels are too sparse
    to form a layer. The position is that of the vertical axis of the object: laterally halfway between the edges of the
    layer, and behind its mean depth by the distance of its class. If the image border truncates the object, it is
    completed to the usual size of its class. All of this is done in the level frame.

    Parameters
    ----------
    samples : Samples
    rect_px : (x1, y1, x2, y2)
    geometry : ImageGeometry
    nearer : sequence of Box3D
        Boxes of possible occluders; in their rectangles, pixels that are not behind them are masked.
    kind : object_classes.ObjectClass

    Returns
    -------
    Box3D or None
        None if less than `LEAST_MEASURED` of the samples have a valid depth and a viewing ray, if the layer contains
        less than `LEAST_SUPPORT` of those with depth, or if the rectangle cannot be undistorted.
    """
    camera, level_from_camera = geometry.camera, geometry.level_from_camera
    across_m, down_m, ahead_m = _level_coordinates(samples, camera, level_from_camera)
    own = samples.valid & (ahead_m > 0)  # nan: the distortion model does not define a ray for every pixel
    measured = np.count_nonzero(own)
    if nearer:
        own = own & ~_occluders(samples, ahead_m, rect_px, nearer, level_from_camera)
    flat_px = _without_distortion(rect_px, camera)
    if flat_px is None or not own.any() or measured < LEAST_MEASURED * own.size:
        return None

    x1, y1, x2, y2 = rect_px
    in_middle = np.exp(-0.5 * ((samples.columns - (x1 + x2) / 2.0) / ((x2 - x1) / 4.0)) ** 2)
    depths_m = np.sort(ahead_m[own])
    layer_m = nearest_dominant_layer(ahead_m[own], np.broadcast_to(in_middle, own.shape)[own], depths_m)
    body_m = within(depths_m, layer_m, BODY_HALF_DEPTH_M)
    support = len(body_m) / float(measured)
    if support < LEAST_SUPPORT:
        return None

    on_body = own & (np.abs(ahead_m - layer_m) <= BODY_HALF_DEPTH_M)
    # The mean without the nearest and the farthest tenth is finer than the median, which has the depth resolution.
    tenth = len(body_m) // 10
    layer_m = body_m[tenth:len(body_m) - tenth].mean()
    top_m, bottom_m = layer_m * _slopes_down(flat_px, camera, level_from_camera)
    above_feet = on_body & (down_m < bottom_m - FEET_M)
    if level_from_camera[1, 2] > LOOKS_DOWN and above_feet.any():
        on_body = above_feet  # the floor beside the feet is as far away as the body
    left_m, right_m = edges(across_m[on_body])
    cut_left, cut_top, cut_right, cut_bottom = cut = truncated_edges(rect_px, geometry.area_px)
    left_m, right_m = complete_truncated_extent(left_m, right_m, cut_left, cut_right, kind.width)
    top_m, bottom_m = complete_truncated_extent(top_m, bottom_m, cut_top, cut_bottom, kind.height)
    surface_m = np.array([(left_m + right_m) / 2, (top_m + bottom_m) / 2, layer_m])
    width_m = max(right_m - left_m, LEAST_WIDTH_M)
    center_m = level_from_camera.T.dot(surface_m * (1 + kind.axis_behind(width_m) / layer_m))
    return Box3D(center_m, np.array([width_m, bottom_m - top_m, width_m]), tuple(rect_px), support, cut)


def level_rotation(up):
    """Rotation (3, 3) from the optical frame to the level frame.

    Parameters
    ----------
    up : array_like, (3,)
        Unit vector in the optical frame.

    Returns
    -------
    numpy.ndarray, (3, 3)
        `LEVEL` if the camera points so steeply up or down, or is rolled so far, that people do not stand upright in the
        image (`MAX_TILT_RAD`, `MAX_ROLL_RAD`).
    """
    down = -np.asarray(up, float)
    if abs(down[2]) > np.sin(MAX_TILT_RAD) or down[1] < np.cos(MAX_ROLL_RAD) * np.hypot(down[0], down[1]):
        return LEVEL
    ahead = np.array([0.0, 0.0, 1.0]) - down[2] * down
    ahead /= np.linalg.norm(ahead)
    return np.stack((np.cross(down, ahead), down, ahead))


def _level_coordinates(samples, camera, level_from_camera):
    """x and z (h, w) of the samples in the level frame, metres; nan for pixels without a ray."""
    x, y = camera.rays(samples.columns, samples.rows[:, np.newaxis])
    return ((to_x * x + to_y * y + to_z) * samples.depth_m for to_x, to_y, to_z in level_from_camera)


def _slopes_down(flat_px, camera, level_from_camera):
    """y / z in the level frame of the rays through the middles of the upper and the lower edge, (2,)."""
    left_px, top_px, right_px, bottom_px = flat_px
    x = ((left_px + right_px) / 2.0 - camera.cx) / camera.fx
    rays = np.array([(x, (row_px - camera.cy) / camera.fy, 1.0) for row_px in (top_px, bottom_px)])
    _across, down, ahead = level_from_camera.dot(rays.T)
    return down / np.maximum(ahead, LEAST_AHEAD)


def _without_distortion(rect_px, camera):
    """Undistort a rectangle by the midpoints of its edges; None if a midpoint has no undistorted position.

    Outside the image, where the distortion is unknown, the distortion at the image border is used.
    """
    if not camera.distortion_model:
        return rect_px
    x1, y1, x2, y2 = rect_px
    middles = np.array([(x1, (y1 + y2) / 2.0), ((x1 + x2) / 2.0, y1), (x2, (y1 + y2) / 2.0), ((x1 + x2) / 2.0, y2)])
    inside = np.clip(middles, 0, (camera.width, camera.height))
    left, top, right, bottom = (middles + camera.undistort(inside) - inside).tolist()
    flat_px = left[0], top[1], right[0], bottom[1]
    return None if np.isnan(flat_px).any() else flat_px


def _occluders(samples, ahead_m, rect_px, boxes, level_from_camera):
    """Samples (h, w) in the rectangle of any of the boxes that are not behind its body.

    What is nearer than that body is masked as well: parts of it may be far in front of its layer.
    """
    masked = np.zeros(ahead_m.shape, bool)
    left, top, right, bottom = rect_px
    for box in boxes:
        x1, y1, x2, y2 = box.rect_px
        if x1 < right and x2 > left and y1 < bottom and y2 > top:
            part = (slice(*samples.rows.searchsorted((y1, y2))), slice(*samples.columns.searchsorted((x1, x2))))
            masked[part] |= ahead_m[part] <= level_from_camera[2].dot(box.center_m) + BODY_HALF_DEPTH_M
    return masked


def nearest_dominant_layer(depths_m, weights, sorted_depths_m):
    """Depth of the trunk of the person: the median of the nearest dominant layer of the weighted depth histogram.

    `depths_m` and `weights` have shape (n,); `sorted_depths_m` holds the same depths, nearest first.
    """
    bins = ((depths_m - sorted_depths_m[0]) / BIN_M).astype(int)
    histogram = np.convolve(np.bincount(bins, weights), np.ones(LAYER_BINS), 'same')
    first = np.argmax(histogram >= FIRST_LAYER_SHARE * histogram.max())
    best = first + np.argmax(histogram[first:first + LAYER_BINS])
    nearest, farthest = ((sorted_depths_m - sorted_depths_m[0]) / BIN_M).searchsorted(
        (best - LAYER_BINS // 2, best + LAYER_BINS // 2 + 1))
    median_m = _median(sorted_depths_m[nearest:farthest])
    for _ in range(MEDIANS):
        before_m, median_m = median_m, _median(within(sorted_depths_m, median_m, TRUNK_HALF_DEPTH_M))
        if median_m == before_m:
            break
    return median_m


def within(sorted_depths_m, middle_m, half_m):
    """The slice of the sorted depths within `half_m` of `middle_m`."""
    offsets_m = sorted_depths_m - middle_m
    return sorted_depths_m[offsets_m.searchsorted(-half_m):offsets_m.searchsorted(half_m, 'right')]


def edges(x_m):
    """Left and right edge of a body with points at x (n,), metres, under the assumption of a uniform width."""
    last = len(x_m) - 1
    rank, part = divmod(last * EDGE_PERCENT, 100)
    after = min(rank + 1, last)
    in_place_m = np.partition(x_m, (rank, after, last - after, last - rank))
    low_m = in_place_m[rank] + (in_place_m[after] - in_place_m[rank]) * part / 100.0
    high_m = in_place_m[last - rank] - (in_place_m[last - rank] - in_place_m[last - after]) * part / 100.0
    beyond_m = (high_m - low_m) * EDGE_PERCENT / (100.0 - 2 * EDGE_PERCENT)
    return low_m - beyond_m, high_m + beyond_m


def complete_truncated_extent(low, high, cut_low, cut_high, usual):
    """Extend low..high of a body that the image border truncates at one end to at least the usual extent."""
    missing = max(0.0, usual - (high - low))
    if cut_low and not cut_high:
        return low - missing, high
    return low, high + (missing if cut_high and not cut_low else 0.0)


def _median(sorted_depths_m):
    last = len(sorted_depths_m) - 1
    return (sorted_depths_m[last // 2] + sorted_depths_m[last - last // 2]) / 2


class Estimator(NamedTuple):
    """Pair of functions: `sample(depth, rect_px)` returns Samples; `estimate(samples, rect_px, geometry, nearer, kind)`
    returns a Box3D or None, given the boxes of possible occluders and the ObjectClass, which is that of `classes`.
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
        return Estimator(sample_depth, estimate_foreground, classes)
    if name == 'median':
        return Estimator(functools.partial(sample_depth, stride_px=stride_px), estimate_median, classes)
    raise ValueError('estimator is %r; foreground or median expected' % name)


def estimate_boxes(depth, rects_px, camera, estimator, implausible=None, level_from_camera=LEVEL, labels=None):
    """Estimate the 3D boxes of all rectangles of one image, front to back, so that nearer boxes mask their pixels.

    Parameters
    ----------
    depth : depth_image.DepthImage
    rects_px : list of (x1, y1, x2, y2)
    camera : camera_model.Camera
    estimator : Estimator
    implausible : list, optional
        Estimates that are not plausible (see `Box3D.is_plausible`) are appended. They do not mask pixels.
    level_from_camera : numpy.ndarray, (3, 3), optional
        Rotation to the level frame, see `level_rotation`. By default the camera is held level.
    labels : sequence of str, optional
        Class names of the rectangles. By default they are those of people.

    Returns
    -------
    list of Box3D or None
        In the order of the rectangles; None without a plausible estimate.
    """
    if len(rects_px) == 0:  # most images show no people
        return []
    boxes, nearer, labels = [None] * len(rects_px), [], labels or [PERSON] * len(rects_px)
    geometry = ImageGeometry(camera, depth.measured_area(), level_from_camera)
    for number in front_to_back(rects_px, camera):
        rect_px, kind = rects_px[number], estimator.classes.of(labels[number])
        box = estimator.estimate(estimator.sample(depth, rect_px), rect_px, geometry, nearer, kind)
        if box is None:
            continue
        box = box._replace(label=labels[number])
        if box.is_plausible:
            boxes[number] = box
            nearer.append(box)
        elif implausible is not None:
            implausible.append(box)
    return boxes


def front_to_back(rects_px, camera):
    """Indices of rectangles, nearest person first: nearer people stand lower in the image, and appear wider."""
    left, _top, right, bottom = np.reshape(rects_px, (-1, 4)).T
    lowest = np.minimum(bottom, camera.height * (1 - CUT_ROWS))
    return np.lexsort((left - right, -lowest)).tolist()


def check_rect(rect_px):
    """Raise ValueError if a rectangle is empty or reversed."""
    x1, y1, x2, y2 = rect_px
    if x1 >= x2 or y1 >= y2:
        raise ValueError('box (%d, %d, %d, %d) is empty or reversed: x1 < x2 and y1 < y2 expected' % (x1, y1, x2, y2))


def truncated_edges(rect_px, area_px):
    """Whether the left, upper, right and lower edge of a rectangle touch the border of the area with depth.

    Returns
    -------
    (bool, bool, bool, bool)
    """
    x1, y1, x2, y2 = rect_px
    left, top, right, bottom = area_px
    across_px, down_px = BORDER_PX + BORDER_SHARE * (x2 - x1), BORDER_PX + BORDER_SHARE * (y2 - y1)
    return (bool(x1 <= left + across_px), bool(y1 <= top + down_px), bool(x2 >= right - across_px),
            bool(y2 >= bottom - down_px))


def _ticks(low, high, limit, stride):
    """Slice of positions `stride` apart, centred in low..high and clipped to 0..limit; exact for ints of any size."""
    count = -(-(high - low) // stride)
    first = low + (high - low - (count - 1) * stride - 1) // 2
    first += max(0, -(first // stride)) * stride
    return slice(first, max(first, min(high, limit)), stride) if first < limit else slice(0, 0)
