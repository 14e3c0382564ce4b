"""Quadrilateral meshes: tubes lofted through superellipses, and boxes.

Convention: metres; faces are wound counter-clockwise when seen from outside.
"""
from typing import NamedTuple

import numpy as np

CELL_M = 0.5  # maximum edge of a face of a box; faces that are partly behind the camera are dropped as a whole


class Mesh(NamedTuple):
    vertices: np.ndarray  # (n, 3)
    normals: np.ndarray   # (n, 3), unit vectors
    faces: np.ndarray     # (m, 4), indices of vertices
    colors: np.ndarray    # (m, 3) of the faces, uint8 RGB
    tone: np.ndarray      # (n,), factor of brightness of the vertices

    def moved(self, position_m, heading_rad):
        """Return the mesh rotated about z (counter-clockwise seen from above), then translated by (x, y, z)."""
        turn = rotation(2, -heading_rad).astype(np.float32)  # applied to row vectors
        return self._replace(vertices=self.vertices.dot(turn) + np.asarray(position_m, np.float32),
                             normals=self.normals.dot(turn))


def rotation(axis, angle):
    """Rotation matrix (3, 3) about x (0), y (1) or z (2)."""
    first, second = (axis + 1) % 3, (axis + 2) % 3
    c, s = np.cos(angle), np.sin(angle)
    matrix = np.eye(3)
    matrix[first, first] = matrix[second, second] = c
    matrix[first, second], matrix[second, first] = -s, s
    return matrix


def loft(centers, half_axes, exponent, sides, axes=(0, 1)):
    """Vertices and faces of a closed tube through superelliptic rings.

    `centers` (rings, 3) and `half_axes` (rings, 2), whose directions are the coordinate axes `axes`; an `exponent` of 2
    is an ellipse, larger values approach a rectangle; `sides` is the even number of vertices in a ring.
    """
    angles = np.linspace(0, 2 * np.pi, sides, endpoint=False)
    vertices = np.repeat(np.asarray(centers, float)[:, None], sides, axis=1)
    for axis, lengths, f in zip(axes, np.transpose(half_axes), (np.cos(angles), np.sin(angles))):
        vertices[..., axis] += lengths[:, None] * np.sign(f) * np.abs(f) ** (2.0 / exponent)
    low = np.arange((len(centers) - 1) * sides).reshape(-1, sides)
    walls = np.stack([low, np.roll(low, -1, 1), np.roll(low, -1, 1) + sides, low + sides], axis=-1).reshape(-1, 4)
    strip = np.arange(sides // 2 - 1)
    cap = np.stack([strip, sides - 1 - strip, sides - 2 - strip, strip + 1], axis=-1)
    top = cap[:, ::-1] + (len(centers) - 1) * sides
    faces = np.concatenate([walls, cap, top])
    vertices = vertices.reshape(-1, 3)
    return vertices, faces if volume(vertices, faces) > 0 else faces[:, ::-1]


def merged(parts):
    offsets = np.cumsum([0] + [len(vertices) for vertices, _faces in parts[:-1]])
    return (np.concatenate([vertices for vertices, _faces in parts]),
            np.concatenate([faces + offset for (_vertices, faces), offset in zip(parts, offsets)]))


def volume(vertices, faces):
    """Volume inside a closed surface; negative if its faces are wound clockwise."""
    a, b, c, d = (vertices[faces[:, corner]] for corner in range(4))
    return float(np.sum(np.cross(c - a, d - b) * (a + b + c + d)) / 24)


def vertex_normals(vertices, faces):
    """Unit normals (n, 3): area-weighted means of the faces around each vertex."""
    a, b, c, d = (vertices[faces[:, corner]] for corner in range(4))
    face_normals = np.cross(c - a, d - b)
    normals = np.zeros_like(vertices)
    for corner in range(4):
        np.add.at(normals, faces[:, corner], face_normals)
    return normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)


def box(size_m, color, random):
    """Box of size (x, y, z) that stands on z = 0 at the origin, with slightly mottled sides that share no vertices."""
    sides = [(axis, side) for axis in range(3) for side in (-1, 1)]
    parts = [_side(np.asarray(size_m, float), axis, side) for axis, side in sides]
    normals = np.concatenate([np.tile(side * np.eye(3)[axis], (len(corners), 1))
                              for (axis, side), (corners, _faces) in zip(sides, parts)])
    vertices, faces = merged(parts)
    return Mesh(vertices.astype(np.float32), normals.astype(np.float32), faces,
                np.tile(np.asarray(color, np.uint8), (len(faces), 1)),
                (1 + 0.05 * random.standard_normal(len(vertices)).clip(-2, 2)).astype(np.float32))


def _side(size, axis, side):
    u, v = (axis + 1) % 3, (axis + 2) % 3
    counts = [int(np.ceil(size[a] / CELL_M)) + 1 for a in (u, v)]
    grid_u, grid_v = np.meshgrid(*[np.linspace(-size[a] / 2, size[a] / 2, n) for a, n in zip((u, v), counts)],
                                 indexing='ij')
    corners = np.empty((grid_u.size, 3))
    corners[:, u], corners[:, v], corners[:, axis] = grid_u.ravel(), grid_v.ravel(), side * size[axis] / 2
    corners[:, 2] += size[2] / 2
    number = np.arange(grid_u.size).reshape(counts)
    faces = np.stack([number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]], axis=-1).reshape(-1, 4)
    return corners, faces if side > 0 else faces[:, ::-1]
