"""3D box estimators: from a rectangle in the depth image to a 3D box.

Conventions: a rectangle (x1, y1, x2, y2) contains the pixels x1 <= u < x2, y1 <= v < y2. Positions are in the camera
optical frame, metres. The level frame of a camera has the same origin, x horizontally to the right, y down and z
horizontally ahead; `level_from_camera` (3, 3) rotates the optical frame to it. Depth layers are layers of z in the
level frame, because people stand upright there.
"""
import functools
from typing import Any, NamedTuple, Optional, Tuple

import numpy as np

from ros_3d_bb.camera.camera_model import Camera
from ros_3d_bb.camera.depth_image import FARTHEST_M as FARTHEST_DEPTH_M
from ros_3d_bb.core.labels import PERSON
from ros_3d_bb.core.limits import FARTHEST_M, LARGEST_M
from ros_3d_bb.core.object_classes import ObjectClasses
from ros_3d_bb.estimation.depth_layers import (BODY_HALF_DEPTH_MM, FARTHEST_LAYER_M, UNKNOWN_MM, SortedDistances, edges,
                                               millimetres, nearest_dominant_layers)

# A box whose edge is this close to the image border, in pixels plus a share of its extent, counts as truncated:
# detectors regress the edge of a truncated person up to 8 pixels inside the image, farther for larger boxes. A person
# who is not truncated there loses little, because only boxes of less than the usual size are completed.
BORDER_PX, BORDER_SHARE = 4, 0.02
# Nearer people stand lower in the image. The lower edges of truncated boxes are compared at this height.
CUT_ROWS = 1 / 30.0  # share of the image height
# Largest number of rows and columns that the foreground estimator samples; on average, it samples two thirds of them.
GRID_ROWS, GRID_COLUMNS = 48, 32
LEAST_MEASURED = 0.02  # minimum share of the samples with depth for an estimate; a lidar gives twice as many
LEAST_SUPPORT = 0.1  # minimum share of the samples with depth in the person's layer for an estimate
LEAST_WIDTH_M = 0.05
# Chosen so that no person behind the dog of config/scenarios/objects.yaml is taken for the dog.
UPPER_SHARE, LOWER_WEIGHT = 0.55, 0.35
SAME_LAYER_M = 0.25  # largest difference of the layers of parts of one body
CLEARLY_NEARER_M = 0.1
CLEARLY_LOWER = 0.02  # share of the image height
LEAST_SIZE = 0.65  # minimum share of its usual size that an object appears to have at its layer
LEAST_BESIDE = 0.25  # minimum share of a rectangle beside another one that shows a layer of its own
CONTAINED = 0.8  # minimum share of a second rectangle of an object in the first one
FILLED = 0.4  # minimum share of both sides of a rectangle that background behind an object fills
MANY = 200  # from this number of rectangles on, those that few others occlude are foremost, too: for speed
MOST_TIES = 256  # pairs of rectangles whose layers beside each other are determined at once: more than in a crowd
LEVEL = np.eye(3)  # of a camera that is held level
MAX_TILT_RAD, MAX_ROLL_RAD = np.radians(65), np.radians(45)
LEAST_AHEAD = 0.05  # lower bound of the horizontal part of a ray
MIDDLE_M = 32.0  # of the lateral positions that fit into 16 bits of millimetres
LOOKS_DOWN, FEET_M = np.sin(np.radians(10)), 0.3  # a camera with more tilt sees the floor beside the feet, this high


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
        width_m, height_m, _width_m = self.size_m.tolist()
        return (all([abs(along_m) < FARTHEST_M for along_m in self.center_m.tolist()])
                and 0 < width_m < LARGEST_M and 0 < height_m < LARGEST_M)


def sample_depth(depth, rect_px, stride_px):
    """Sample a rectangle on a centred grid of every `stride_px` pixels, clipped to the image (thesis 3.4.2).

    Parameters
    ----------
    depth : depth_image.DepthImage
    rect_px : (x1, y1, x2, y2)
        There are no samples in an empty or reversed rectangle.
    stride_px : int

    Returns
    -------
    Samples
    """
    height, width = depth.shape
    x1, y1, x2, y2 = map(int, rect_px)
    return _samples_at(depth, _ticks(y1, y2, height, stride_px), _ticks(x1, x2, width, stride_px))


def sample_grid(depth, rect_px):
    """Sample the visible part of a rectangle on the grid of the foreground estimator, as `sample_depth`."""
    (slices,) = _grid_slices(*_grids(np.array([rect_px], np.int64), depth.shape))
    return _samples_at(depth, *slices)


def _samples_at(depth, rows, columns):
    """Samples in rows and columns (slices)."""
    height, width = depth.shape
    depth_m = depth.part(rows, columns).astype(float) * depth.scale_m
    valid = (depth_m > 0) & (depth_m <= FARTHEST_DEPTH_M)
    return Samples(np.arange(width)[columns], np.arange(height)[rows], depth_m, valid)


def estimate_median(samples, rect_px, geometry):
    """Estimate a box as in the thesis (3.4.2): per-axis median of the sampled points, size from the box at that depth.

    Returns a Box3D, or None without a valid depth or if the rectangle cannot be undistorted. The tilt of the camera is
    ignored.
    """
    camera = geometry.camera
    across, down = camera.rays(samples.columns, samples.rows[:, np.newaxis])
    seen = samples.valid & ~np.isnan(across)  # the distortion model does not define a ray for every pixel
    (flat_px,) = _without_distortion(np.array([rect_px]), camera)
    if not (np.isfinite(flat_px).all() and seen.any()):
        return None
    points = np.stack((across * samples.depth_m, down * samples.depth_m, samples.depth_m), axis=-1)[seen]
    x1, y1, x2, y2 = flat_px
    center_m = np.median(points, axis=0)
    width_m, height_m = (x2 - x1) / camera.fx * center_m[2], (y2 - y1) / camera.fy * center_m[2]
    on_body = np.abs(samples.depth_m[samples.valid] - center_m[2]) <= BODY_HALF_DEPTH_MM / 1000.0
    return Box3D(center_m, np.array([width_m, height_m, width_m]), tuple(rect_px), on_body.mean(),
                 truncated_edges(rect_px, geometry.area_px))


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
    image = _SampledImage(depth, rects_px, geometry, kinds)
    boxes = [None] * len(rects_px)
    while image.pending.any():
        for number, box in image.estimates(image.foremost()):
            boxes[number] = box
    return boxes


class _SampledImage(object):
    """Depth samples of all rectangles of an image, and the boxes estimated from them; see `estimate_foreground`."""

    def __init__(self, depth, rects_px, geometry, kinds):
        self._rects_px, self._kinds, self._geometry = list(map(tuple, rects_px)), kinds, geometry
        rects_px = np.array(rects_px, np.int64)
        first, stride, count = _grids(rects_px, depth.shape)
        self._slices, camera = _grid_slices(first, stride, count), geometry.camera
        flat_px = _without_distortion(rects_px, camera)
        self._slopes_down = _slopes_down(flat_px, geometry)
        last = np.maximum(count - 1, 0)[..., None]  # repeated to the size of the grid: there may be no rays beyond
        rows, columns = (first[:, axis, None] + stride[:, axis, None] * np.minimum(np.arange(size), last[:, axis])
                         for axis, size in enumerate((GRID_ROWS, GRID_COLUMNS)))
        depth_m = _grid_depths(depth, self._slices, count)
        x, y = (along.astype(np.float32) for along in camera.rays(columns[:, None, :], rows[:, :, None]))

        def along_axis(axis):
            to_x, to_y, to_z = geometry.level_from_camera[axis].tolist()
            return ((to_x * x + (to_y * y + to_z)) * depth_m).reshape(len(depth_m), -1)
        ahead_m = along_axis(2)
        with np.errstate(invalid='ignore'):  # nan: the distortion model has no ray for every pixel
            known = (ahead_m > 0) & (ahead_m <= FARTHEST_LAYER_M)
        self._ahead_mm = millimetres(ahead_m, known)
        self._across_mm = millimetres(np.clip(along_axis(0) + MIDDLE_M, 0, 2 * MIDDLE_M), known)
        self._down_m = along_axis(1) if geometry.level_from_camera[1, 2] > LOOKS_DOWN else None
        self._measured = np.count_nonzero(known, axis=1)
        self._usable = self._measured >= np.maximum(LEAST_MEASURED * count.prod(axis=1), 1)
        self._usable &= np.isfinite(flat_px).all(axis=1)
        self._weights = _weights(columns, rects_px, count[:, 0])
        self._counts = count
        self._area_px, self._shared_px = _areas(rects_px)
        self._lowest_px = np.minimum(rects_px[:, 3], camera.height * (1 - CUT_ROWS))
        self._clearly_lower_px = CLEARLY_LOWER * camera.height
        self._truncated = [truncated_edges(rect_px, geometry.area_px) for rect_px in self._rects_px]
        extent_px = np.maximum(rects_px[:, 2:] - rects_px[:, :2], 1).max(axis=1)
        usual_m = np.array([0 if any(edges) else max(kind.width, kind.height)
                            for edges, kind in zip(self._truncated, kinds)])
        self._nearest_m = LEAST_SIZE * usual_m * camera.fy / extent_px  # nearer objects would be unusually small
        groups = [kind.group for kind in kinds]
        self._alike = np.array([[group is not None and group == other for other in groups] for group in groups])
        self.pending = self._usable.copy()  # without an estimate yet
        self._changed = self._usable.copy()  # since the layer was determined
        self._layer_m = np.zeros(len(rects_px))
        # Layers of rectangles beside each other one, or of the whole rectangles where there is no layer beside it
        self._beside_m = np.zeros(self._shared_px.shape)
        self._is_beside = np.zeros(self._shared_px.shape, bool)
        self._repeats = np.zeros(len(rects_px), bool)  # may be of the object of a larger rectangle

    def foremost(self):
        """Numbers of the pending rectangles that no pending rectangle of a nearer object overlaps.

        The nearer of two objects is the one with the nearer layer. A layer that both rectangles show belongs to the one
        that shows it beside the other one, too. If that does not decide, of two objects of one kind the nearer one is
        clearly lower in the image, has a clearly nearer layer or is larger, in this order. Of different kinds, it is
        the one that is not too small for the layer, which may be another object's; otherwise the one that appears
        smaller, as a person on a couch.
        """
        pending = np.flatnonzero(self.pending)
        pairs = np.ix_(pending, pending)
        overlap, alike, area_px = self._shared_px[pairs] > 0, self._alike[pairs], self._area_px[pending]
        self._determine_layers(pending, overlap)
        farther_m = self._beside_m[pairs] - self._beside_m[pairs].T
        lower_px = self._lowest_px[pending] - self._lowest_px[pending][:, None]
        larger = np.where(area_px == area_px[:, None], pending < pending[:, None], area_px > area_px[:, None])
        tied = np.abs(farther_m) < SAME_LAYER_M
        small = self._layer_m[pending] < self._nearest_m[pending]
        unlike_nearer = np.where(small == small[:, None], ~larger, small[:, None])
        nearer = np.where(np.abs(farther_m) < CLEARLY_NEARER_M, larger, farther_m > 0)
        nearer = np.where(np.abs(lower_px) > self._clearly_lower_px, lower_px > 0, nearer)
        nearer = overlap & np.where(tied, np.where(alike, nearer, unlike_nearer), farther_m > 0)
        contained = self._shared_px[pairs] >= CONTAINED * area_px[:, None]
        self._repeats[pending] |= (tied & alike & nearer & contained).any(axis=1)
        in_front = np.count_nonzero(nearer, axis=1)
        if in_front.all():  # three or more occlude each other in a circle
            return pending[[np.lexsort((-area_px, -self._lowest_px[pending]))[0]]]
        return pending[in_front <= len(pending) // MANY]

    def _determine_layers(self, pending, overlap):
        """Determine the layers of pending rectangles (k,) that `overlap` (k, k), if they or the others have changed."""
        changed = self._changed[pending] & overlap.any(axis=1)
        if not changed.any():
            return
        numbers, pairs = pending[changed], np.ix_(pending, pending)
        self._layer_m[numbers] = self._layers(self._ahead_mm[numbers], numbers) / 1000
        self._changed[numbers] = False
        layers_m = self._layer_m[pending]
        overlap = overlap & (changed | changed[:, None])
        self._beside_m[pairs] = np.where(overlap, layers_m[:, None], self._beside_m[pairs])
        self._is_beside[pairs] &= ~overlap
        tied = overlap & (np.abs(layers_m - layers_m[:, None]) < SAME_LAYER_M)
        tied &= self._shared_px[pairs] <= (1 - LEAST_BESIDE) * self._area_px[pending][:, None]
        first, second = pending[np.argwhere(tied)[:MOST_TIES].T]
        beside_mm = self._ahead_mm[first]
        for samples_mm, number, other in zip(beside_mm, first.tolist(), second.tolist()):
            self._mask(samples_mm, number, other, UNKNOWN_MM)
        seen = (beside_mm < UNKNOWN_MM).any(axis=1)
        if seen.any():
            self._beside_m[first[seen], second[seen]] = self._layers(beside_mm[seen], first[seen]) / 1000
            self._is_beside[first[seen], second[seen]] = True

    def _layers(self, ahead_mm, numbers):
        """Layers (k,) of samples (k, samples) of the rectangles with the given numbers (k,), millimetres."""
        return nearest_dominant_layers(ahead_mm, self._weights[numbers], SortedDistances(ahead_mm))

    def estimates(self, group):
        """Pairs (number, Box3D) of the rectangles in `group` (k,) that have a box; what these occlude is masked."""
        self.pending[group] = False
        ahead_mm = self._ahead_mm[group]
        ordered = SortedDistances(ahead_mm)
        layers_mm = nearest_dominant_layers(ahead_mm, self._weights[group], ordered)
        first, end = ordered.within(layers_mm, BODY_HALF_DEPTH_MM)
        supports = (end - first) / self._measured[group]
        # The mean without the nearest and the farthest tenth is finer than the median, which has the depth resolution.
        tenth = (end - first) // 10
        layers_m = ordered.means(first + tenth, end - tenth) / 1000
        nearest_mm, farthest_mm = (ordered.at(rank).astype(np.uint16)[:, None] for rank in (first, end - 1))
        top_m, bottom_m = layers_m * self._slopes_down[:, group]
        on_body = (ahead_mm >= nearest_mm) & (ahead_mm <= farthest_mm)
        left_m, right_m = self._edges(group, on_body, bottom_m)
        valid = (supports >= LEAST_SUPPORT) & ~(self._repeats[group] & self._fills_sides(group, on_body))
        values = zip(valid.tolist(), group.tolist(), supports.tolist(), layers_m.tolist(), left_m.tolist(),
                     right_m.tolist(), top_m.tolist(), bottom_m.tolist())
        return [(number, self._box(number, support, *extents_m)) for is_valid, number, support, *extents_m in values
                if is_valid]

    def _mask_behind(self, number, farthest_mm):
        """Mask what is not farther than `farthest_mm` in the pending rectangles that overlap an estimated one."""
        for other in np.flatnonzero(self.pending & (self._shared_px[number] > 0)).tolist():
            layer_m = self._beside_m[other, number]
            is_farther = layer_m - self._beside_m[number, other] >= SAME_LAYER_M and (
                self._is_beside[other, number] or not self._alike[other, number])
            own_mm = 1000 * layer_m - BODY_HALF_DEPTH_MM if is_farther else UNKNOWN_MM  # from there on, its own body
            self._mask(self._ahead_mm[other], other, number, min(farthest_mm, own_mm))
            self._changed[other] = True
            self.pending[other] = (self._ahead_mm[other] < UNKNOWN_MM).any()

    def _fills_sides(self, group, on_body):
        """Whether the samples (k, samples) `on_body` fill at least `FILLED` of both sides of rectangles."""
        on_body, members = on_body.reshape(-1, GRID_ROWS, GRID_COLUMNS), np.arange(len(group))
        rows, columns = self._counts[group].T
        return np.all([np.count_nonzero(on_body[members, :, column], axis=1) >= FILLED * rows
                       for column in (0, columns - 1)], axis=0)

    def _edges(self, group, on_body, bottom_m):
        """Left and right edges (2, k) of the bodies whose samples are given (k, samples), metres."""
        if self._down_m is not None:
            # The floor beside the feet is as far away as the body.
            above_feet = on_body & (self._down_m[group] < bottom_m[:, None] - FEET_M)
            on_body = np.where(above_feet.any(axis=1)[:, None], above_feet, on_body)
        across_mm = np.where(on_body, self._across_mm[group], np.uint16(UNKNOWN_MM))
        return np.array(edges(SortedDistances(across_mm))) / 1000 - MIDDLE_M

    def _mask(self, samples_mm, number, occluder, limit_mm):
        """Mask the samples of a rectangle that are in the rectangle of an occluder and not farther than `limit_mm`."""
        left, top, right, bottom = self._rects_px[occluder]
        rows, columns = self._slices[number]
        rows = slice(_rank(rows, top), _rank(rows, bottom))
        columns = slice(_rank(columns, left), _rank(columns, right))
        part = samples_mm.reshape(GRID_ROWS, GRID_COLUMNS)[rows, columns]
        part[part <= limit_mm] = UNKNOWN_MM

    def _box(self, number, support, layer_m, left_m, right_m, top_m, bottom_m):
        rect_px, kind = self._rects_px[number], self._kinds[number]
        cut_left, cut_top, cut_right, cut_bottom = cut = self._truncated[number]
        left_m, right_m = complete_truncated_extent(left_m, right_m, cut_left, cut_right, kind.width)
        top_m, bottom_m = complete_truncated_extent(top_m, bottom_m, cut_top, cut_bottom, kind.height)
        surface_m = np.array([(left_m + right_m) / 2, (top_m + bottom_m) / 2, layer_m])
        width_m = max(right_m - left_m, LEAST_WIDTH_M)
        behind_m = kind.axis_behind(width_m)
        center_m = self._geometry.level_from_camera.T.dot(surface_m * (1 + behind_m / layer_m))
        box = Box3D(center_m, np.array([width_m, bottom_m - top_m, width_m]), rect_px, support, cut)
        if box.is_plausible:
            self._mask_behind(number, int(1000 * (layer_m + behind_m)) + BODY_HALF_DEPTH_MM)
        return box


def _areas(rects_px):
    """Areas (n,) of rectangles (n, 4), and those that they share with each other one (n, n; diagonal: 0), pixels."""
    x1, y1, x2, y2 = rects_px.T
    shared_px = (np.maximum(np.minimum(x2, x2[:, None]) - np.maximum(x1, x1[:, None]), 0)
                 * np.maximum(np.minimum(y2, y2[:, None]) - np.maximum(y1, y1[:, None]), 0))
    area_px = shared_px.diagonal().copy()
    np.fill_diagonal(shared_px, 0)
    return area_px, shared_px


def _grids(rects_px, shape):
    """Grids of samples in the visible parts of rectangles (n, 4): first pixels, strides and numbers of pixels, each
    (n, 2) as (row, column).
    """
    low = np.minimum(np.maximum(rects_px[:, 1::-1], 0), shape)
    extent = np.maximum(np.minimum(np.maximum(rects_px[:, :1:-1], 0), shape) - low, 0)
    stride = np.maximum(-(-extent // (GRID_ROWS, GRID_COLUMNS)), 1)
    count = -(-extent // stride)
    return low + (extent - (count - 1) * stride - 1) // 2, stride, count


def _grid_slices(first, stride, count):
    """Slices (rows, columns) of grids."""
    ends = first + stride * count
    return [(slice(top, bottom, down), slice(left, right, across)) for (top, left), (bottom, right), (down, across)
            in zip(first.tolist(), ends.tolist(), stride.tolist())]


def _grid_depths(depth, slices, count):
    """Depths (n, GRID_ROWS, GRID_COLUMNS) at the pixels of grids, metres; 0 where none is measured."""
    values = np.zeros((len(slices), GRID_ROWS, GRID_COLUMNS), np.float32)
    for grid, (rows, columns), grid_slices in zip(values, count.tolist(), slices):
        grid[:rows, :columns] = depth.part(*grid_slices)
    values *= np.float32(depth.scale_m)
    values[~((values > 0) & (values <= FARTHEST_DEPTH_M))] = 0
    return values


def _weights(columns, rects_px, row_counts):
    """Weights (n, samples) of the samples in columns (n, GRID_COLUMNS) and the first `row_counts` (n,) rows: a Gaussian
    about the middle of a rectangle, and less in its lower part, where something may stand before the legs.
    """
    left, right = rects_px[:, 0, None], rects_px[:, 2, None]
    across = np.exp(-0.5 * ((columns - (left + right) / 2.0) / ((right - left) / 4.0)) ** 2)
    down = np.where(np.arange(GRID_ROWS) < UPPER_SHARE * row_counts[:, None], 1, LOWER_WEIGHT)
    return (across[:, None] * down[..., None]).reshape(len(columns), -1)


def _rank(pixels, limit):
    """Number of pixels (slice) before a limit; more than all if the limit is beyond the last one."""
    return max(0, -((pixels.start - limit) // pixels.step))


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


def _slopes_down(flat_px, geometry):
    """y / z in the level frame of the rays through the middles of the upper and of the lower edges, (2, n)."""
    camera, level_from_camera = geometry.camera, geometry.level_from_camera
    x = ((flat_px[:, 0] + flat_px[:, 2]) / 2.0 - camera.cx) / camera.fx
    y = (flat_px[:, 1::2].T - camera.cy) / camera.fy
    (down_x, down_y, down_z), (ahead_x, ahead_y, ahead_z) = level_from_camera[1:].tolist()
    return (down_x * x + down_y * y + down_z) / np.maximum(ahead_x * x + ahead_y * y + ahead_z, LEAST_AHEAD)


def _without_distortion(rects_px, camera):
    """Undistort rectangles (n, 4) by the midpoints of their edges; nan if a midpoint has no undistorted position.

    Outside the image, where the distortion is unknown, the distortion at the image border is used.
    """
    if not camera.distortion_model:
        return rects_px
    x1, y1, x2, y2 = rects_px.T
    x, y = (x1 + x2) / 2.0, (y1 + y2) / 2.0
    middles = np.stack((x1, y, x, y1, x2, y, x, y2), axis=1).reshape(-1, 4, 2)
    inside = np.clip(middles, 0, (camera.width, camera.height))
    flat_px = middles + camera.undistort(inside) - inside
    return np.stack((flat_px[:, 0, 0], flat_px[:, 1, 1], flat_px[:, 2, 0], flat_px[:, 3, 1]), axis=1)


def complete_truncated_extent(low, high, cut_low, cut_high, usual):
    """Extend low..high of a body that the image border truncates at one end to at least the usual extent."""
    missing = max(0.0, usual - (high - low))
    if cut_low and not cut_high:
        return low - missing, high
    return low, high + (missing if cut_high and not cut_low else 0.0)


class Estimator(NamedTuple):
    """Pair of functions: `sample(depth, rect_px)` returns the Samples in a rectangle, and `estimate(depth, rects_px,
    geometry, kinds)` the Box3D or None of each rectangle, whose ObjectClass in `kinds` is that of `classes`.
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
        return Estimator(sample_grid, estimate_foreground, classes)
    if name == 'median':
        sample = functools.partial(sample_depth, stride_px=stride_px)

        def estimate(depth, rects_px, geometry, _kinds):
            return [estimate_median(sample(depth, rect_px), rect_px, geometry) for rect_px in rects_px]
        return Estimator(sample, estimate, classes)
    raise ValueError('estimator is %r; foreground or median expected' % name)


def estimate_boxes(depth, rects_px, camera, estimator, implausible=None, level_from_camera=LEVEL, labels=None):
    """Estimate the 3D boxes of all rectangles of one image.

    Parameters
    ----------
    depth : depth_image.DepthImage
    rects_px : list of (x1, y1, x2, y2)
    camera : camera_model.Camera
    estimator : Estimator
    implausible : list, optional
        Estimates that are not plausible (see `Box3D.is_plausible`) are appended.
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
    labels = labels or [PERSON] * len(rects_px)
    geometry = ImageGeometry(camera, depth.measured_area(), level_from_camera)
    boxes = estimator.estimate(depth, rects_px, geometry, list(map(estimator.classes.of, labels)))
    for number, box in enumerate(boxes):
        if box is None:
            continue
        box = box._replace(label=labels[number])
        boxes[number] = box if box.is_plausible else None
        if implausible is not None and not box.is_plausible:
            implausible.append(box)
    return boxes


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
