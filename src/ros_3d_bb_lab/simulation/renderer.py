"""Renderer of a room with meshes: colour, inverse depth, and the object in each pixel.

The faces of each object are painted from back to front into an image of face numbers. The planes of the faces give the
inverse depth (1/m along the optical axis) and the brightness of each pixel, and the nearest object wins.
"""
from typing import NamedTuple

import cv2
import numpy as np

from ros_3d_bb_lab.simulation.room import FLOOR, copy_where

MIN_DEPTH_M = 0.1  # faces with a vertex at less depth are not drawn
SUBPIXEL_BITS = 4
LIGHT = np.array([.34, .25, .9], np.float32)  # direction of the main light, approximately a unit vector
AMBIENT, DIFFUSE, HEADLIGHT = .52, .36, .16
BRIGHTNESS_STEPS = 128
SHADOW_DARKNESS, SHADOW_REDUCTION = .38, 4


class Rendering(NamedTuple):
    color: np.ndarray          # (h, w, 3), uint8, RGB
    inverse_depth: np.ndarray  # (h, w), float32
    objects: np.ndarray        # (h, w), uint8: 1 + the index of the object; 0 is the room
    areas: list                # number of pixels of each object if it were alone in the room
    inside: list               # share of each object that lies inside the image, 0..1


def render(room, meshes, shadows, camera, world_from_camera):
    """Render a room (RenderedRoom) and at most 254 meshes in it, in world coordinates. Returns a Rendering.

    `shadows` [(x, y, radius), ...] are soft shadows on the floor, in metres.
    """
    color, inverse_depth, surfaces = room.draw(camera, world_from_camera)
    _draw_shadows(color, surfaces, shadows, camera, world_from_camera)
    rendering = Rendering(color, inverse_depth, np.zeros(inverse_depth.shape, np.uint8), [], [])
    for mesh in meshes:
        _render_object(rendering, mesh, camera, world_from_camera)
    return rendering


def _render_object(rendering, mesh, camera, world_from_camera):
    rotation, position = (part.astype(np.float32) for part in (world_from_camera[:3, :3], world_from_camera[:3, 3]))
    points = (mesh.vertices - position).dot(rotation)
    inverse = 1 / np.maximum(points[:, 2], np.float32(MIN_DEPTH_M))
    pixels = np.stack([points[:, 0] * inverse * np.float32(camera.fx) + np.float32(camera.cx),
                       points[:, 1] * inverse * np.float32(camera.fy) + np.float32(camera.cy)])
    corners = pixels[:, mesh.faces.T]
    visible, inside = _visible_faces(corners, points[:, 2][mesh.faces.T], camera)
    rendering.areas.append(0)
    rendering.inside.append(inside if visible.size else 0.0)
    if visible.size == 0:
        return
    faces, corners = mesh.faces[visible], corners[:, :, visible]
    low, high = corners.min(axis=(1, 2)), corners.max(axis=(1, 2))
    x0, y0 = np.maximum(low.astype(int) - 1, 0).tolist()
    x1, y1 = np.minimum(high.astype(int) + 2, (camera.width, camera.height)).tolist()
    corners = corners - np.array([[[x0]], [[y0]]], np.float32)
    numbers = _paint_numbers(corners, inverse[faces].sum(axis=1), (y1 - y0, x1 - x0))
    planes = _planes(corners, np.stack([inverse, _brightness(mesh, world_from_camera)])[:, faces.T])
    limits = (inverse[faces].min(), inverse[faces].max()), (0, 255. / BRIGHTNESS_STEPS)
    inverse_depth, brightness = _images(numbers, planes, limits)
    brightness = (brightness * BRIGHTNESS_STEPS).astype(np.uint8)
    colors = np.concatenate([np.zeros((1, 3), np.uint8), mesh.colors[visible]])
    color = cv2.multiply(np.take(colors, numbers, axis=0), cv2.merge([brightness] * 3), scale=1. / BRIGHTNESS_STEPS)

    rendering.areas[-1] = cv2.countNonZero(inverse_depth)
    window = slice(y0, y1), slice(x0, x1)
    nearer = cv2.compare(inverse_depth, rendering.inverse_depth[window], cv2.CMP_GT)
    copy_where(nearer, inverse_depth, rendering.inverse_depth[window])
    copy_where(nearer, color, rendering.color[window])
    rendering.objects[window][nearer > 0] = len(rendering.areas)


def _visible_faces(corners, depth_m, camera):
    """Indices of the faces that are turned towards the camera, in front of it, and at least partly in the image.

    Also returns the share of the area of the faces in front of the camera that lies in the image.
    """
    area = _cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])
    facing = (area < -.04) & (depth_m.min(axis=0) > MIN_DEPTH_M)
    low, high, center = corners.min(axis=1), corners.max(axis=1), corners.mean(axis=1)
    visible = facing & (high >= 0).all(axis=0) & (low[0] < camera.width) & (low[1] < camera.height)
    inside = facing & (center >= 0).all(axis=0) & (center[0] < camera.width) & (center[1] < camera.height)
    return np.flatnonzero(visible), float(area[inside].sum() / min(area[facing].sum(), -1e-9))


def _cross(a, b):
    return a[0] * b[1] - a[1] * b[0]


def _brightness(mesh, world_from_camera):
    lit = AMBIENT + DIFFUSE * np.maximum(mesh.normals.dot(LIGHT), -.4)
    return (lit + HEADLIGHT * np.maximum(-mesh.normals.dot(world_from_camera[:3, 2].astype(np.float32)), 0)) * mesh.tone


def _paint_numbers(corners, nearness, shape):
    """1 + the index of the face in each pixel, 0 for none. Faces are painted from far to near."""
    numbers = np.zeros(shape, np.int32)
    polygons = np.rint(np.clip(corners, -4000, 4000) * 2 ** SUBPIXEL_BITS).astype(np.int32).transpose(2, 1, 0)
    order = np.argsort(nearness, kind='mergesort')
    for number, polygon in zip((order + 1).tolist(), polygons[order]):
        cv2.fillConvexPoly(numbers, polygon, number, 8, SUBPIXEL_BITS)
    return numbers


def _planes(corners, values):
    """Linear approximation of values (k, 4, m) at the corners of faces: coefficients (k, 3, m) of a u + b v + c.

    The gradient is given by the differences along the two diagonals, the offset by the mean at the centre.
    """
    first, second = corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1]
    area = _cross(first, second)
    rise_first, rise_second = values[:, 2] - values[:, 0], values[:, 3] - values[:, 1]
    a = (rise_first * second[1] - rise_second * first[1]) / area
    b = (rise_second * first[0] - rise_first * second[0]) / area
    center = corners.mean(axis=1)
    return np.stack([a, b, values.mean(axis=1) - a * center[0] - b * center[1]], axis=1).astype(np.float32)


def _images(numbers, planes, limits):
    """Images (k, h, w) of k values, each clipped to its limits; 0 in pixels without a face."""
    covered = np.flatnonzero(numbers)
    face = np.take(numbers, covered) - 1
    v, u = (part.astype(np.float32) for part in np.divmod(covered, numbers.shape[1]))
    images = np.zeros((len(planes), numbers.size), np.float32)
    for image, (a, b, c), (low, high) in zip(images, planes, limits):
        image[covered] = np.clip(a[face] * u + b[face] * v + c[face], low, high)
    return images.reshape((-1,) + numbers.shape)


def _draw_shadows(color, surfaces, shadows, camera, world_from_camera):
    mask = np.zeros((camera.height // SHADOW_REDUCTION, camera.width // SHADOW_REDUCTION), np.float32)
    angles = np.linspace(0, 2 * np.pi, 16, endpoint=False)
    rotation, position = world_from_camera[:3, :3], world_from_camera[:3, 3]
    for x, y, radius in shadows:
        ring = np.stack([x + radius * np.cos(angles), y + radius * np.sin(angles), np.zeros(16)], axis=-1)
        points = (ring - position).dot(rotation)
        if points[:, 2].min() > MIN_DEPTH_M:
            pixels = camera.project(points) / SHADOW_REDUCTION
            cv2.fillConvexPoly(mask, np.rint(np.clip(pixels, -999, 9999)).astype(np.int32), SHADOW_DARKNESS)
    rows = np.flatnonzero(mask.any(axis=1))
    if rows.size == 0:
        return
    mask = cv2.resize(cv2.GaussianBlur(mask, (0, 0), 2.2), (camera.width, camera.height))
    band = slice(max(0, (rows[0] - 7) * SHADOW_REDUCTION), (rows[-1] + 8) * SHADOW_REDUCTION)
    keep = 255 - np.rint(mask[band] * 255 * (surfaces[band] == FLOOR)).astype(np.uint8)
    color[band] = cv2.multiply(color[band], cv2.merge([keep] * 3), scale=1 / 255.)
