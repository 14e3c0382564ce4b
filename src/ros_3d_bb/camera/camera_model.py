"""Pinhole camera model and rigid transforms.

Convention: pixel (u, v) is the centre of the pixel in column u and row v, both counted from 0; a camera optical frame
has x right, y down, z forward (REP 103); lengths are in metres. A transform `b_from_a` is a 4x4 matrix that transforms
points from frame a to frame b.
"""
from typing import Any, NamedTuple, Sequence, Tuple, Union

import numpy as np

from ros_3d_bb.camera.distortion import checked_distortion, distort, undistort

Vector = Union[Sequence[float], np.ndarray]
OPTICAL_ROTATION = (-0.5, 0.5, -0.5, 0.5)  # quaternion of an optical frame whose z axis is the body's x axis (REP 103)

# Plausible fields of view along the longer side of the image, degrees: RGB-D cameras have 55 (Kinect) to 120 (Azure).
VIEWS_DEG = 20.0, 150.0


class Camera(NamedTuple('Camera', [('width', int), ('height', int), ('fx', float), ('fy', float), ('cx', float),
                                   ('cy', float), ('distortion_model', str), ('distortion', Tuple[float, ...])])):
    """Intrinsics of a camera; image size, focal lengths and principal point in pixels.

    `distortion_model` and `distortion` are as in sensor_msgs/CameraInfo, see `distortion.MODELS`. They are normalised:
    a camera without lens distortion has '' and (). Raises ValueError if the size is not positive, a focal length is not
    positive and finite, the principal point is not finite, or `checked_distortion` rejects the distortion.
    """

    __slots__ = ()

    def __new__(cls, width: float, height: float, fx: float, fy: float, cx: float, cy: float,
                distortion_model: str = '', distortion: Sequence[float] = ()) -> 'Camera':
        camera = super(Camera, cls).__new__(cls, int(width), int(height), float(fx), float(fy), float(cx), float(cy),
                                            *checked_distortion(distortion_model, distortion))
        if camera.width <= 0 or camera.height <= 0:
            raise ValueError('camera size %d x %d is not positive' % (width, height))
        if not (np.isfinite(camera[2:6]).all() and camera.fx > 0 and camera.fy > 0):
            raise ValueError('camera intrinsics fx=%g fy=%g cx=%g cy=%g are not usable: focal lengths must be positive'
                             % camera[2:6])
        return camera

    def deproject(self, pixels: Any, depth_m: Any) -> np.ndarray:
        """Deproject pixels (..., 2) with depths (...), metres, to points (..., 3) in the optical frame (thesis 3.4.1).

        x and y are nan for pixels without a ray under the distortion model. Inverse of `project`.
        """
        pixels, depth_m = np.asarray(pixels, float), np.asarray(depth_m, float)
        x, y = (along * depth_m for along in self.rays(pixels[..., 0], pixels[..., 1]))
        return np.stack((x, y, np.broadcast_to(depth_m, x.shape)), axis=-1)

    def rays(self, u: np.ndarray, v: np.ndarray) -> Tuple[np.ndarray, np.ndarray]:
        """Viewing rays x / z and y / z of the pixels in columns u and rows v; nan for pixels without a ray.

        u and v are arrays that broadcast to one shape: (1, w) and (h, 1), for example, give a grid. So are x and y.
        """
        x, y = (u - self.cx) / self.fx, (v - self.cy) / self.fy
        if not self.distortion_model:
            return x, y
        pixels = np.stack(np.broadcast_arrays(x, y), axis=-1)
        return tuple(np.moveaxis(undistort(self.distortion_model, self.distortion, pixels), -1, 0))

    def project(self, points: Any) -> np.ndarray:
        """Project points (..., 3) in the optical frame, z > 0, to pixels (..., 2). Inverse of `deproject`.

        Pixels may be outside the image; they are nan for rays without a pixel under the distortion model.
        """
        points = np.asarray(points, float)
        x, y = points[..., 0] / points[..., 2], points[..., 1] / points[..., 2]
        if self.distortion_model:
            x, y = np.moveaxis(distort(self.distortion_model, self.distortion, np.stack((x, y), axis=-1)), -1, 0)
        return np.stack((x * self.fx + self.cx, y * self.fy + self.cy), axis=-1)

    def undistort(self, pixels: np.ndarray) -> np.ndarray:
        """Positions of pixels (..., 2) without distortion, with the same fx, fy, cx and cy; nan without a ray."""
        if not self.distortion_model:
            return pixels
        return self.deproject(pixels, 1.0)[..., :2] * (self.fx, self.fy) + (self.cx, self.cy)


def check_intrinsics(camera: Camera) -> None:
    """Raise ValueError if the intrinsics cannot be those of a camera with images of this size, but belong to images of
    another size, for example: positions would be wrong by a factor.
    """
    if not (0 <= camera.cx <= camera.width and 0 <= camera.cy <= camera.height):
        raise ValueError('the principal point (%.0f, %.0f) of K is outside of the image of %d x %d pixels; the '
                         'calibration of images of this size expected' % (camera[4:6] + camera[:2]))
    view = np.degrees(2 * np.arctan(np.divide(camera[:2], camera[2:4]) / 2)).max()
    if not VIEWS_DEG[0] <= view <= VIEWS_DEG[1]:
        raise ValueError('the field of view is %.1f degrees by K (focal length %.0f) and the image size %d x %d; %g to '
                         '%g degrees expected' % ((view, camera.fx) + camera[:2] + VIEWS_DEG))


def transform_from(translation: Vector, quaternion: Vector) -> np.ndarray:
    """Create a 4x4 matrix from a translation (x, y, z) in metres and a quaternion (x, y, z, w), which is normalised.
    Raises ValueError if it cannot be (zero, nan or inf).
    """
    given = np.asarray(quaternion, float)
    norm = np.sqrt(given.dot(given))
    if not (np.isfinite(norm) and norm > 1e-6):
        raise ValueError('quaternion %s is not a rotation' % (tuple(given.tolist()),))
    x, y, z, w = (given / norm).tolist()
    return np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w), translation[0]],
                     [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w), translation[1]],
                     [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y), translation[2]],
                     [0.0, 0.0, 0.0, 1.0]])


def quaternion_from(matrix: np.ndarray) -> np.ndarray:
    """Quaternion (x, y, z, w), w >= 0, of the rotation of a 4x4 matrix. Inverse of `transform_from`."""
    m = matrix
    xx, yy, zz = np.diag(m)[:3]
    # All rows of 4 q q^T are multiples of q; the row of the largest component is the most accurate.
    squares = np.array([1 + xx - yy - zz, 1 - xx + yy - zz, 1 - xx - yy + zz, 1 + xx + yy + zz])
    products = np.array([[squares[0], m[0, 1] + m[1, 0], m[0, 2] + m[2, 0], m[2, 1] - m[1, 2]],
                         [m[0, 1] + m[1, 0], squares[1], m[1, 2] + m[2, 1], m[0, 2] - m[2, 0]],
                         [m[0, 2] + m[2, 0], m[1, 2] + m[2, 1], squares[2], m[1, 0] - m[0, 1]],
                         [m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1], squares[3]]])
    row = products[int(np.argmax(squares))]
    quaternion = row / np.linalg.norm(row)
    return quaternion if quaternion[3] >= 0 else -quaternion


def transform_points(b_from_a: np.ndarray, points: Any) -> np.ndarray:
    """Transform points (..., 3) from frame a to frame b."""
    return np.asarray(points, float).dot(b_from_a[:3, :3].T) + b_from_a[:3, 3]
