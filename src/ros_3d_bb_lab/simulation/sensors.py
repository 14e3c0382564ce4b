"""Model of a RealSense D435i: depth images with the errors of active stereo, and colour images with blur and noise.

The depth camera matches the images of two imagers. It measures the disparity d = f B / z in steps of 1/32 px, so depth
has levels C / n with integer n. The noise of disparity is constant, so that of depth grows with the square of the
distance. Surfaces that the second imager does not see have no depth; they form a shadow to the left of near objects.
All parameters were fitted to the images of the thesis (compared in `test/unit/test_simulator.py`). Their depth is
aligned to the colour camera, and so is the output of this model.

Convention: inverse depth is 1/z in the camera's optical frame, 1/m; depth images are 16UC1, millimetres, 0 = no depth.
"""
from typing import NamedTuple

import cv2
import numpy as np

# The random fields are this much larger than the image; each frame uses a random part. For two frames in a thousand
# the parts overlap so much that the noise is correlated.
SPARE_PX = 512
COLOR_FIELDS, COLOR_SPARE_PX = 4, 64  # each image has one of these fields of colour noise
BLUR_PX, GRAIN_PX = .65, .6  # sigma of the blur of colour images and of the correlation of their noise
# A pixel is hidden from the second imager if another pixel to its right projects this much farther to the left.
HIDDEN_BY_PX = 0.3


class StereoParams(NamedTuple):
    """Parameters of the depth camera. Disparities are in pixels of the imagers, lengths in those of colour images."""

    focal_baseline_px_m: float = 19.066875  # f B of the imagers (381 px, 50 mm): levels of 610140 / n mm
    steps_per_px: int = 32                  # disparity steps per pixel
    noise_px: float = 0.065                 # sigma of the spatially correlated noise of disparity
    noise_kernel_px: float = 4.5            # sigma of the Gaussian kernel of its correlation
    white_noise_px: float = 0.012           # sigma of the uncorrelated noise of disparity
    jitter_px: float = 0.9                  # sigma of the displacement of silhouettes, along x and along y
    jitter_kernel_px: float = 2.0           # sigma of the Gaussian kernel of its correlation
    shadow_baseline_m: float = 0.0606       # distance of the second imager from the colour camera
    shadow_extra_px: int = 4                # extra width of shadows, because the imagers match patches
    hole_share: float = 5e-4                # share of the pixels in small holes, away from silhouettes
    hole_kernel_px: float = 1.0             # sigma of the Gaussian kernel that sets the size of holes
    min_disparity_px: float = 30 / 32.      # that of 20.3 m, the largest depth in 110 real frames
    max_disparity_px: float = 126.          # that of 0.15 m, the search range of the camera


class StereoCamera(object):
    """Depth images of a simulated D435i, aligned to the colour camera `camera` (camera_model.Camera)."""

    def __init__(self, camera, seed=0, params=StereoParams()):
        self._shape = camera.height, camera.width
        self._seed, self._params = seed, params
        self._shadow_px_m = camera.fx * params.shadow_baseline_m
        self._columns = np.tile(np.arange(camera.width, dtype=np.float32), (camera.height, 1))
        self._depth_mm = _depth_table(params)
        field_shape = camera.height + SPARE_PX, camera.width + SPARE_PX
        random = np.random.RandomState(seed)
        self._noise = _noise_field(field_shape, params, random)
        self._holes = _hole_field(field_shape, params, random)
        self._grid = np.stack(np.meshgrid(*(np.arange(size, dtype=np.int16) for size in self._shape[::-1])), -1)
        self._jitter = _jitter_field(field_shape, params, random)

    def measure(self, inverse_depth, number):
        """Depth image (height, width), uint16, of one frame. It depends only on the seed, the number and the scene.

        Inverse depth is float32 and 0 in pixels without a surface. The noise of different numbers is independent.
        """
        random = np.random.RandomState([self._seed, number])
        noise, holes, jitter = (self._cut(random) for _ in range(3))
        inverse_depth = self._jittered(inverse_depth, jitter)
        # Rounds to the nearest step. Values out of range and nan become levels whose depth in the table is 0.
        level = cv2.addWeighted(inverse_depth, self._params.focal_baseline_px_m * self._params.steps_per_px,
                                self._noise[noise], 1, 0, dtype=cv2.CV_16U)
        depth_mm = self._depth_mm[level]
        depth_mm[cv2.bitwise_or(self._shadow(inverse_depth), self._holes[holes]) > 0] = 0
        return depth_mm

    def _cut(self, random):
        """Random part of the fields, of the size of the image: slices of rows and columns."""
        top, left = random.randint(0, SPARE_PX + 1, 2)
        return slice(top, top + self._shape[0]), slice(left, left + self._shape[1])

    def _jittered(self, inverse_depth, window):
        """Scene with ragged silhouettes and flying pixels, whose depth lies between that of near and far surfaces."""
        whole, fraction = (field[window] for field in self._jitter)
        return cv2.remap(inverse_depth, cv2.add(self._grid, whole), fraction, cv2.INTER_LINEAR,
                         borderMode=cv2.BORDER_REPLICATE)

    def _shadow(self, inverse_depth):
        """255 in pixels that nearer surfaces hide from the second imager, which is to the right of the first."""
        second = cv2.scaleAdd(inverse_depth, -self._shadow_px_m, self._columns)
        leftmost = np.minimum.accumulate(second[:, ::-1], axis=1)[:, ::-1]  # of all pixels from here to the right
        hidden = cv2.compare(second, leftmost + np.float32(HIDDEN_BY_PX), cv2.CMP_GT)
        kernel = np.ones((1, self._params.shadow_extra_px + 1), np.uint8)
        return cv2.dilate(hidden, kernel, anchor=(0, 0))  # to the left


class ColorSensor(object):
    """Blur and noise of colour images. The noise, of `sigma` grey levels, depends only on the seed and the number."""

    def __init__(self, camera, seed, sigma):
        random = np.random.RandomState(seed)
        self._seed, self._shape = seed, (camera.height, camera.width)
        field_shape = camera.height + COLOR_SPARE_PX, camera.width + COLOR_SPARE_PX, 3
        self._fields = [_color_field(random, field_shape, sigma) for _ in range(COLOR_FIELDS)]

    def capture(self, color, number):
        """Apply blur and noise to a rendered image (h, w, 3), uint8. Returns a new image."""
        random = np.random.RandomState([self._seed, number])
        field = self._fields[random.randint(COLOR_FIELDS)]
        y, x = random.randint(COLOR_SPARE_PX, size=2)
        noise = field[y:y + self._shape[0], x:x + self._shape[1]]
        return cv2.add(cv2.GaussianBlur(color, (3, 3), BLUR_PX), noise, dtype=cv2.CV_8U)


def _depth_table(params):
    """Depth of each level, (65536,), uint16, in millimetres; 0 if it is out of range or exceeds 16 bits."""
    level = np.arange(1, 1 << 16)
    depth_mm = np.rint(1000. * params.focal_baseline_px_m * params.steps_per_px / level)
    disparity_px = level / float(params.steps_per_px)
    valid = ((disparity_px >= params.min_disparity_px) & (disparity_px <= params.max_disparity_px)
             & (depth_mm < 1 << 16))
    return np.append(0, np.where(valid, depth_mm, 0)).astype(np.uint16)


def _noise_field(shape, params, random):
    noise_px = _correlated(shape, params.noise_kernel_px, random) * params.noise_px
    noise_px += random.standard_normal(shape) * params.white_noise_px
    return noise_px.astype(np.float32) * np.float32(params.steps_per_px)


def _hole_field(shape, params, random):
    field = _correlated(shape, params.hole_kernel_px, random)
    return (field > np.percentile(field, 100 * (1 - params.hole_share))).astype(np.uint8) * 255


def _jitter_field(shape, params, random):
    """Displacements of pixels in the fastest format of cv2.remap: integer parts (..., 2) and fractions."""
    x, y = ((_correlated(shape, params.jitter_kernel_px, random) * params.jitter_px).astype(np.float32)
            for _ in range(2))
    return cv2.convertMaps(x, y, cv2.CV_16SC2)


def _correlated(shape, kernel_px, random):
    """Gaussian noise of sigma 1, float64, spatially correlated by a Gaussian kernel of sigma `kernel_px`."""
    margin = int(np.ceil(4 * kernel_px))
    kernel = cv2.getGaussianKernel(2 * margin + 1, kernel_px) if margin else np.ones((1, 1))
    white = random.standard_normal(tuple(size + 2 * margin for size in shape))
    smooth = cv2.sepFilter2D(white, cv2.CV_64F, kernel, kernel) / (kernel ** 2).sum()
    return smooth[margin:margin + shape[0], margin:margin + shape[1]]


def _color_field(random, shape, sigma):
    noise = random.standard_normal(shape).astype(np.float32)
    noise = cv2.GaussianBlur(noise, (0, 0), GRAIN_PX)
    return np.rint(noise * (sigma / noise.std())).clip(-127, 127).astype(np.int8)
