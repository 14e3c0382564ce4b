"""3D box estimators: from a rectangle in the depth image to a 3D box.

Convention: a rectangle (x1, y1, x2, y2) contains the pixels x1 <= u < x2, y1 <= v < y2. Positions are in the camera
optical frame, metres. In `sorted_depths_m` (nearest first), a layer of depth is a slice and its median an element.
"""
import functools
from typing import Any, NamedTuple, Optional, Tuple

import numpy as np

from ros_3d_bb.camera.depth_image import FARTHEST_M as FARTHEST_DEPTH_M
from ros_3d_bb.core.limits import FARTHEST_M, LARGEST_M, USUAL_HEIGHT_M, USUAL_WIDTH_M

# A box whose edge is this close to the image border counts as truncated: detectors round to whole pixels and regress
# the edge of a truncated person a pixel or two inside the image.
BORDER_PX = 2
SAMPLES_WANTED = 2000  # approximate number of pixels that the foreground estimator samples
AXIS_BEHIND_SURFACE_M = 0.09  # mean over standing and walking bodies of the simulation, seen from all sides
LEAST_SUPPORT = 0.1  # minimum share of the samples in the person's layer for an estimate
LEAST_WIDTH_M = 0.05

# Half the depth extent of a person with stretched arms; points farther from the median are not part of the person.
BODY_HALF_DEPTH_M = 0.35
TRUNK_HALF_DEPTH_M = 0.25  # without arms and legs: a wall close behind must not shift the median
BIN_M, LAYER_BINS = 0.05, 5  # bin width of the depth histogram, and thickness of a layer in bins
MEDIANS = 3  # maximum number of iterations of the median of the trunk
FIRST_LAYER_SHARE = 0.5  # the nearest layer with at least this share of the largest layer weight is the person
EDGE_PERCENT = 5  # percentage of the layer's pixels ignored at the left and at the right: arms, flying pixels


class Samples(NamedTuple):
    """Grid of depth samples in one rectangle: columns (w,), rows (h,), raw values (h, w), depth_m (h, w) = values times
    `scale_m`, and valid (h, w), whether depth was measured.
    """

    columns: np.ndarray
    rows: np.ndarray
    values: np.ndarray
    scale_m: float
    depth_m: np.ndarray
    valid: np.ndarray

    @property
    def pixels(self):
        """Pixel coordinates (u, v) of the grid, (h, w, 2)."""
        return np.stack(np.meshgrid(self.columns, self.rows), axis=-1)


class Box3D(NamedTuple):
    """An upright cylinder in the camera optical frame, with quality measures.

    `center_m` (3,) and `size_m` (width, height, width) are in metres; `rect_px` is the source rectangle; `support` is
    the share 0..1 of the sampled pixels that belong to its depth layer; `truncated_edges` states whether the left,
    upper, right and lower edge of the rectangle touch the image border; `covariance_m2` (3, 3) is that of the centre,
    None if unknown.
    """

    center_m: np.ndarray
    size_m: np.ndarray
    rect_px: Tuple[int, int, int, int]
    support: float
    truncated_edges: Tuple[bool, bool, bool, bool]
    covariance_m2: Optional[Any] = None

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
    height, width = depth.values.shape
    x1, y1, x2, y2 = map(int, rect_px)
    if stride_px is None:
        visible_columns = min(max(x2, 0), width) - min(max(x1, 0), width)
        visible_rows = min(max(y2, 0), height) - min(max(y1, 0), height)
        visible_px = max(0, visible_columns) * max(0, visible_rows)
        stride_px = max(1, int(np.sqrt(visible_px / SAMPLES_WANTED)))
    columns, rows = _ticks(x1, x2, width, stride_px), _ticks(y1, y2, height, stride_px)
    values = depth.values[rows, columns]
    depth_m = values.astype(float) * depth.scale_m
    valid = (depth_m > 0) & (depth_m <= FARTHEST_DEPTH_M)
    return Samples(np.arange(width)[columns], np.arange(height)[rows], values, depth.scale_m, depth_m, valid)


def estimate_median(samples, rect_px, camera, _nearer=()):
    """Estimate a box as in the thesis (3.4.2): per-axis median of the sampled points, size from the box at that depth.

    Parameters and return value are those of `estimate_foreground`; nearer boxes are ignored, and there is no minimum
    support.
    """
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
    return Box3D(center_m, np.array([width_m, height_m, width_m]), tuple(rect_px),
                 np.count_nonzero(on_body) / float(samples.valid.size), truncated_edges(rect_px, camera))


def estimate_foreground(samples, rect_px, camera, nearer=()):
    """Estimate a box from the person's depth layer: the nearest layer that is dominant near the middle of the box.

    Background beside and between the limbs may fill most of a box, but it is farther away. Flying pixels are too sparse
    to form a layer. The position is that of the body's axis: laterally halfway between the edges of the layer, and
    `AXIS_BEHIND_SURFACE_M` behind its mean depth. If the image border truncates the body, it is completed to the usual
    size.

    Parameters
    ----------
    samples : Samples
    rect_px : (x1, y1, x2, y2)
    camera : camera_model.Camera
    nearer : sequence of Box3D
        Boxes of possible occluders; their pixels are masked.

    Returns
    -------
    Box3D or None
        None if no sample has a valid depth and a viewing ray, if the layer contains less than `LEAST_SUPPORT` of the
        samples, or if the rectangle cannot be undistorted.
    """
    flat_px, columns_px, own = rect_px, samples.columns, samples.valid
    if camera.distortion_model:
        flat_px = _without_distortion(rect_px, camera)
        columns_px = camera.undistort(samples.pixels)[..., 0]
        own = own & ~np.isnan(columns_px)  # the distortion model does not define a ray for every pixel
    if nearer:
        own = _mask_occluders(own, samples, rect_px, nearer)
    if flat_px is None or not own.any():
        return None

    x1, y1, x2, y2 = rect_px
    in_middle = np.exp(-0.5 * ((samples.columns - (x1 + x2) / 2.0) / ((x2 - x1) / 4.0)) ** 2)
    # The raw values are sorted, because numpy sorts 16-bit integers in linear time.
    depths_m = np.sort(samples.values[own], kind='mergesort').astype(float) * samples.scale_m
    layer_m = nearest_dominant_layer(samples.depth_m[own], np.broadcast_to(in_middle, own.shape)[own], depths_m)
    body_m = within(depths_m, layer_m, BODY_HALF_DEPTH_M)
    support = len(body_m) / float(own.size)
    if support < LEAST_SUPPORT:
        return None

    on_body = own & (np.abs(samples.depth_m - layer_m) <= BODY_HALF_DEPTH_M)
    across_m = (columns_px - camera.cx) / camera.fx * samples.depth_m
    left_m, right_m = edges(across_m[on_body])
    # The mean without the nearest and the farthest tenth is finer than the median, which has the depth resolution.
    tenth = len(body_m) // 10
    layer_m = body_m[tenth:len(body_m) - tenth].mean()
    _left_px, top_px, _right_px, bottom_px = flat_px
    top_m, bottom_m = (top_px - camera.cy) / camera.fy * layer_m, (bottom_px - camera.cy) / camera.fy * layer_m
    cut_left, cut_top, cut_right, cut_bottom = cut = truncated_edges(rect_px, camera)
    left_m, right_m = complete_truncated_extent(left_m, right_m, cut_left, cut_right, USUAL_WIDTH_M)
    top_m, bottom_m = complete_truncated_extent(top_m, bottom_m, cut_top, cut_bottom, USUAL_HEIGHT_M)
    surface_m = np.array([(left_m + right_m) / 2, (top_m + bottom_m) / 2, layer_m])
    width_m = max(right_m - left_m, LEAST_WIDTH_M)
    return Box3D(surface_m * (1 + AXIS_BEHIND_SURFACE_M / layer_m), np.array([width_m, bottom_m - top_m, width_m]),
                 tuple(rect_px), support, cut)


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


def _mask_occluders(own, samples, rect_px, boxes):
    """The mask `own` (h, w) without the samples in the rectangle and the depth layer of any of the boxes."""
    own = own.copy()
    left, top, right, bottom = rect_px
    for box in boxes:
        x1, y1, x2, y2 = box.rect_px
        if x1 < right and x2 > left and y1 < bottom and y2 > top:
            part = (slice(*samples.rows.searchsorted((y1, y2))), slice(*samples.columns.searchsorted((x1, x2))))
            own[part] &= np.abs(samples.depth_m[part] - box.center_m[2]) > BODY_HALF_DEPTH_M
    return own


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
    """Pair of functions: `sample(depth, rect_px)` returns Samples; `estimate(samples, rect_px, camera, nearer)` returns
    a Box3D or None, given the boxes of possible occluders.
    """

    sample: Any
    estimate: Any


def estimator_named(name, stride_px=20):
    """Create the estimator foreground or median; `stride_px` is the grid spacing of the estimator median.

    Raises ValueError if the name is unknown or the stride is not positive.
    """
    if stride_px < 1:
        raise ValueError('stride is %d; at least 1 expected' % stride_px)
    if name == 'foreground':
        return Estimator(sample_depth, estimate_foreground)
    if name == 'median':
        return Estimator(functools.partial(sample_depth, stride_px=stride_px), estimate_median)
    raise ValueError('estimator is %r; foreground or median expected' % name)


def estimate_boxes(depth, rects_px, camera, estimator, implausible=None):
    """Estimate the 3D boxes of all rectangles of one image, front to back, so that nearer boxes mask their pixels.

    Parameters
    ----------
    depth : depth_image.DepthImage
    rects_px : list of (x1, y1, x2, y2)
    camera : camera_model.Camera
    estimator : Estimator
    implausible : list, optional
        Estimates that are not plausible (see `Box3D.is_plausible`) are appended. They do not mask pixels.

    Returns
    -------
    list of Box3D or None
        In the order of the rectangles; None without a plausible estimate.
    """
    boxes, nearer = [None] * len(rects_px), []
    _left, top, _right, bottom = np.reshape(rects_px, (-1, 4)).T
    for number in np.lexsort((top, -bottom)).tolist():  # nearer people stand lower in the image and are larger
        rect_px = rects_px[number]
        box = estimator.estimate(estimator.sample(depth, rect_px), rect_px, camera, nearer)
        if box is None:
            continue
        if box.is_plausible:
            boxes[number] = box
            nearer.append(box)
        elif implausible is not None:
            implausible.append(box)
    return boxes


def check_rect(rect_px):
    """Raise ValueError if a rectangle is empty or reversed."""
    x1, y1, x2, y2 = rect_px
    if x1 >= x2 or y1 >= y2:
        raise ValueError('box (%d, %d, %d, %d) is empty or reversed: x1 < x2 and y1 < y2 expected' % (x1, y1, x2, y2))


def truncated_edges(rect_px, camera):
    """Whether the left, upper, right and lower edge of a rectangle touch the image border, (bool, bool, bool, bool)."""
    x1, y1, x2, y2 = rect_px
    return (bool(x1 <= BORDER_PX), bool(y1 <= BORDER_PX), bool(x2 >= camera.width - BORDER_PX),
            bool(y2 >= camera.height - BORDER_PX))


def _ticks(low, high, limit, stride):
    """Slice of positions `stride` apart, centred in low..high and clipped to 0..limit; exact for ints of any size."""
    count = -(-(high - low) // stride)
    first = low + (high - low - (count - 1) * stride - 1) // 2
    first += max(0, -(first // stride)) * stride
    return slice(first, max(first, min(high, limit)), stride) if first < limit else slice(0, 0)
