"""Registration of raw depth images: depth as the colour camera sees it, measured by a depth camera beside it.

Each depth pixel is a point that is projected into the colour image. There it covers the size of its pixel, and the
nearest point wins. Only the part of the image that is asked for is registered, in the resolution that is asked for: the
samples in a box need a few thousand points, the whole image hundreds of thousands.
"""
from typing import Optional, Tuple

import numpy as np

from ros_3d_bb.camera.camera_model import Camera, transform_points
from ros_3d_bb.camera.images import FARTHEST_M, DepthImage

NEAREST_M = 0.4  # lower bound of the depth of people, for the part of the depth image that is registered
BORDER_AT_M = 2.0  # depth at which the border of the depth image is projected; people are cut at about this distance
OVERLAP = 1.1  # size of a point relative to the distance of its neighbours, so that rounding leaves no gaps
EDGE_PX = 2  # margin of the part of the depth image that is registered


class Registration(object):
    """Geometry of a colour and a depth `camera_model.Camera`, computed once for all of their images. `color_from_depth`
    (4, 4) transforms between their optical frames.
    """

    def __init__(self, color_camera: Camera, depth_camera: Camera, color_from_depth: np.ndarray) -> None:
        self.color_camera, self.depth_camera, self.color_from_depth = color_camera, depth_camera, color_from_depth
        self._depth_from_color = np.linalg.inv(color_from_depth)
        u, v = np.arange(depth_camera.width), np.arange(depth_camera.height)[:, np.newaxis]
        x, y = np.broadcast_arrays(*depth_camera.rays(u, v))
        self._rays = np.stack((x, y, np.ones(x.shape)), axis=-1).dot(color_from_depth[:3, :3].T).astype(np.float32)
        self._offset_m = color_from_depth[:3, 3].astype(np.float32)
        self._pitch_px = color_camera.fx / depth_camera.fx, color_camera.fy / depth_camera.fy
        self.area_px = self._area()

    def register(self, depth: DepthImage, rows: slice, columns: slice) -> np.ndarray:
        """Register a raw DepthImage to the pixels in rows and columns (slices) of the colour image. Returns the depth
        (h, w) in metres; 0 where none was measured.
        """
        v, u = range(*rows.indices(self.color_camera.height)), range(*columns.indices(self.color_camera.width))
        if not (u and v):
            return np.zeros((len(v), len(u)))
        across, down = _Cells(u, self._pitch_px[0]), _Cells(v, self._pitch_px[1])
        part = self._part_towards(v, u, across.stride, down.stride)
        with np.errstate(all='ignore'):  # of what is no depth
            depth_m = depth.values[part].astype(np.float32) * np.float32(depth.scale_m)
            points = self._rays[part] * depth_m[..., np.newaxis] + self._offset_m
            pixels = self.color_camera.project(points)
            column, in_columns = across.of(pixels[..., 0])
            row, in_rows = down.of(pixels[..., 1])
            used = in_columns & in_rows & (depth_m > 0) & (depth_m <= FARTHEST_M) & (points[..., 2] > 0)
        nearest_m = np.full(down.count * across.count, np.inf)
        cells = row[used].astype(int) * across.count + column[used].astype(int)
        np.minimum.at(nearest_m, cells, points[..., 2][used].astype(float))
        nearest_m[np.isinf(nearest_m)] = 0
        return nearest_m.reshape(down.count, across.count)[down.of_samples[:, np.newaxis], across.of_samples]

    def _part_towards(self, rows: range, columns: range, stride_x: int, stride_y: int) -> Tuple[slice, slice]:
        """Slices of the depth image that contain what a rectangle of the colour image shows from `NEAREST_M` on."""
        height, width = self._rays.shape[:2]
        whole = slice(0, height, stride_y), slice(0, width, stride_x)
        grid = [(u, v) for u in (columns[0], columns[len(columns) // 2], columns[-1])
                for v in (rows[0], rows[len(rows) // 2], rows[-1])]
        ahead = self.color_camera.deproject(grid, 1.0)
        points = transform_points(self._depth_from_color, np.concatenate((NEAREST_M * ahead, FARTHEST_M * ahead)))
        if not (points[:, 2] > 0).all():  # nan, or the depth camera looks elsewhere
            return whole
        pixels = self.depth_camera.project(points)
        if not np.isfinite(pixels).all():
            return whole
        margin_px = EDGE_PX + np.array((columns.step, rows.step)) / self._pitch_px
        left, top = np.clip(pixels.min(axis=0) - margin_px, 0, (width, height)).astype(int).tolist()
        right, bottom = np.clip(pixels.max(axis=0) + margin_px + 1, 0, (width, height)).astype(int).tolist()
        return slice(top, bottom, stride_y), slice(left, right, stride_x)

    def _area(self) -> Tuple[int, int, int, int]:
        """Rectangle (x1, y1, x2, y2) of the colour image in which depth is measured, for a depth of `BORDER_AT_M`."""
        points = self._rays * BORDER_AT_M + self.color_from_depth[:3, 3]
        width, height = self.color_camera[:2]
        edges_px = []
        for edge, axis in ((points[:, 0], 0), (points[0], 1), (points[:, -1], 0), (points[-1], 1)):
            with np.errstate(all='ignore'):  # points beside the view of the colour camera
                pixels = self.color_camera.project(edge)[:, axis]
            pixels = pixels[np.isfinite(pixels) & (edge[:, 2] > 0)]
            edges_px.append(np.median(pixels) if pixels.size else np.nan)
        known_px = np.where(np.isfinite(edges_px), edges_px, (0, 0, width, height))
        left, top, right, bottom = np.clip(known_px, 0, (width, height, width, height)).astype(int).tolist()
        return (left, top, right, bottom) if left < right and top < bottom else (0, 0, width, height)


class RegisteredDepth(object):
    """A raw depth image as the colour camera sees it. Has the interface of `images.DepthImage`, in metres."""

    scale_m = 1.0

    def __init__(self, depth: DepthImage, registration: Registration) -> None:
        self._depth, self._registration = depth, registration
        self._values: Optional[np.ndarray] = None

    @property
    def shape(self) -> Tuple[int, int]:
        camera = self._registration.color_camera
        return camera.height, camera.width

    @property
    def values(self) -> np.ndarray:
        """The whole image, (height, width); registered when it is first used."""
        if self._values is None:
            self._values = self.part(slice(None), slice(None))
        return self._values

    def part(self, rows: slice, columns: slice) -> np.ndarray:
        return self._registration.register(self._depth, rows, columns)

    def at(self, u: np.ndarray, v: np.ndarray) -> Tuple[np.ndarray, np.ndarray]:
        depth_m = self.values[v, u]
        return depth_m, depth_m > 0

    def measured_area(self) -> Tuple[int, int, int, int]:
        return self._registration.area_px


class _Cells(object):
    """Cells of one axis of the registered part: one for each sample, or larger ones if the points are farther apart.

    Of several depth pixels in a cell, every `stride`-th is used. A point counts only within its own size of the middle
    of the cell: a larger cell would widen what is near.
    """

    def __init__(self, samples: range, pitch_px: float) -> None:
        step_px = samples.step
        self.stride = max(1, int(step_px / (OVERLAP * pitch_px)))
        point_px = OVERLAP * pitch_px * self.stride
        self._size_px = max(step_px, point_px)
        self._first_px = samples[0] - step_px / 2.0
        self._reach = min(1.0, point_px / self._size_px) / 2
        self.of_samples = ((np.arange(len(samples)) + 0.5) * step_px / self._size_px).astype(int)
        self.count = self.of_samples[-1] + 1

    def of(self, pixels: np.ndarray) -> Tuple[np.ndarray, np.ndarray]:
        """Numbers of the cells at pixel coordinates (n,), as floats, and whether a point there counts."""
        offsets = (pixels - self._first_px) / self._size_px
        numbers = np.floor(offsets)
        return numbers, (numbers >= 0) & (numbers < self.count) & (np.abs(offsets - numbers - 0.5) <= self._reach)
