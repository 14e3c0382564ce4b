"""Rectangular room of six textured planes, each drawn by one perspective warp of its texture."""
from typing import NamedTuple, Tuple

import cv2
import numpy as np

from ros_3d_bb_lab.simulation import textures

Vector = Tuple[float, float, float]
FLOOR = 0  # number of the floor among the surfaces
WALL_COLORS = ((210, 206, 196), (205, 200, 190), (196, 192, 180), (202, 196, 186))


class Surface(NamedTuple):
    """Textured plane. The texture starts at `origin` and extends along the unit vectors `right` and `down`."""

    normal: Vector  # outward
    origin: Vector
    right: Vector
    down: Vector
    texture: np.ndarray
    ppm: float      # pixels per metre


class RenderedRoom(object):
    """Room with the bounds (x0, x1, y0, y1), seen from inside."""

    def __init__(self, bounds_m, height_m, random):
        x0, x1, y0, y1 = bounds_m
        width, depth = x1 - x0, y1 - y0
        self._surfaces = [
            Surface((0, 0, -1), (x0, y0, 0), (1, 0, 0), (0, 1, 0), textures.floor(width, depth, random),
                    textures.FLOOR_PPM),
            Surface((0, 0, 1), (x0, y0, height_m), (1, 0, 0), (0, 1, 0), textures.ceiling(width, depth),
                    textures.CEILING_PPM)]
        corners = (((1, 0, 0), (x1, y1), (0, -1, 0), depth), ((-1, 0, 0), (x0, y0), (0, 1, 0), depth),
                   ((0, 1, 0), (x0, y1), (1, 0, 0), width), ((0, -1, 0), (x1, y0), (-1, 0, 0), width))
        for (normal, corner, right, length), color in zip(corners, WALL_COLORS):
            self._surfaces.append(Surface(normal, corner + (height_m,), right, (0, 0, -1),
                                          textures.wall(length, height_m, color, random), textures.WALL_PPM))

    def draw(self, camera, world_from_camera):
        """Draw the image of a camera inside the room.

        Returns colour (h, w, 3), uint8 RGB, inverse depth (h, w), float32, and the number of the surface (h, w), uint8.
        """
        shape = (camera.height, camera.width)
        inverse_depth, surfaces = np.full(shape, 1e-3, np.float32), np.full(shape, 255, np.uint8)
        color = np.zeros(shape + (3,), np.uint8)
        plane = np.empty(shape, np.float32)
        lines = [_inverse_depth_of(surface, camera, world_from_camera) for surface in self._surfaces]
        for number, (a, b, c) in enumerate(lines):
            if c + max(0, a * camera.width) + max(0, b * camera.height) > 0:  # otherwise it is behind the camera
                np.add((b * np.arange(camera.height) + c).astype(np.float32)[:, None],
                       (a * np.arange(camera.width)).astype(np.float32), out=plane)
                surfaces[cv2.compare(plane, inverse_depth, cv2.CMP_GT) > 0] = number
                cv2.max(plane, inverse_depth, inverse_depth)
        for number, (surface, line) in enumerate(zip(self._surfaces, lines)):
            _paint(color, cv2.inRange(surfaces, number, number), surface, line, camera, world_from_camera)
        return color, inverse_depth, surfaces


def _inverse_depth_of(surface, camera, world_from_camera):
    """Coefficients (a, b, c) of the inverse depth a u + b v + c of a plane at pixel (u, v)."""
    rotation, position = world_from_camera[:3, :3], world_from_camera[:3, 3]
    distance_m = np.dot(surface.normal, surface.origin) - np.dot(surface.normal, position)
    along = rotation.T.dot(surface.normal) / distance_m
    a, b = along[0] / camera.fx, along[1] / camera.fy
    return np.array([a, b, along[2] - a * camera.cx - b * camera.cy])


def _paint(color, mask, surface, line, camera, world_from_camera):
    x, y, width, height = cv2.boundingRect(mask)
    if width == 0:
        return
    ray = np.array([[1 / camera.fx, 0, -camera.cx / camera.fx], [0, 1 / camera.fy, -camera.cy / camera.fy], [0, 0, 1]])
    rotation, from_origin = world_from_camera[:3, :3], world_from_camera[:3, 3] - surface.origin
    texture_from_pixel = np.stack(
        [(np.dot(axis, rotation).dot(ray) + np.dot(axis, from_origin) * line) * surface.ppm
         for axis in (surface.right, surface.down)] + [line]).dot([[1, 0, x], [0, 1, y], [0, 0, 1]])
    part = cv2.warpPerspective(surface.texture, texture_from_pixel, (width, height),
                               flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP, borderMode=cv2.BORDER_REPLICATE)
    copy_where(mask[y:y + height, x:x + width], part, color[y:y + height, x:x + width])


def copy_where(mask, source, target):
    """Copy the pixels of an image under a mask to another image (OpenCV 3.2 has no cv2.copyTo)."""
    cv2.bitwise_or(source, source, target, mask)
