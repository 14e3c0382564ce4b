"""What a RealSense D435i measures of a scene: depth with the errors of active stereo.

The camera compares the images of two imagers. It measures the disparity d = f B / z in steps of 1/32 px, so that depth
comes in levels C / n with integer n, and its noise is one of disparity: it grows with the square of the distance. What
the second imager does not see has no depth: a shadow on the left of everything near. All numbers were fitted on the
thesis' frames (`test/unit/test_stereo.py` compares), which are aligned to the colour camera; so is what is made here.

Convention: inverse depth is 1/z in the camera's optical frame, 1/m; depth images are 16UC1, millimetres, 0 = no depth.
"""
from typing import NamedTuple

import cv2
import numpy as np

# The random fields are this much larger than the image; each frame cuts its part out at a random place. Two frames in
# a thousand come so close to each other that their noise is correlated.
SPARE_PX = 512
# A pixel is hidden from the second imager where another one is this much in front of it there.
HIDDEN_BY_PX = 0.3


class StereoParams(NamedTuple):
    """How the camera measures. Pixels are those of the colour image, except for disparities: those of the imagers.

    Farthest: 20.3 m, the farthest depth in 110 real frames. Nearest: 0.15 m, the 126 px that the camera searches.
    """

    focal_baseline_px_m: float = 19.066875  # f B of the imagers (381 px, 50 mm): levels of 610140 / n mm
    steps_per_px: int = 32                  # disparity steps in a pixel
    noise_px: float = 0.065                 # sigma of the correlated noise of disparity, new in every frame
    noise_kernel_px: float = 4.5            # sigma of the Gaussian that correlates it over the image
    white_noise_px: float = 0.012           # sigma of the noise of disparity of each pixel alone
    jitter_px: float = 0.9                  # sigma of the silhouettes' displacement, along x and along y
    jitter_kernel_px: float = 2.0           # sigma of the Gaussian that correlates it
    shadow_baseline_m: float = 0.0606       # distance of the second imager from the colour camera
    shadow_extra_px: int = 4                # added to every shadow: the imagers compare patches, not pixels
    hole_share: float = 5e-4                # share of the pixels in small holes, away from silhouettes
    hole_kernel_px: float = 1.0             # sigma of the Gaussian that makes them a few pixels large
    farthest_px: float = 30 / 32.           # smallest disparity measured
    nearest_px: float = 126.                # largest disparity measured


class StereoCamera(object):
    """Depth images of a simulated D435i, aligned to its colour camera.

    Parameters
    ----------
    camera : ros_3d_bb.geometry.Camera
        The colour camera.
    seed : int
        0 to 2**32 - 1; one camera's noise.
    params : StereoParams

    Raises
    ------
    ValueError
        If a parameter makes no sense (`check_params`), or the seed is out of range.
    """

    def __init__(self, camera, seed=0, params=StereoParams()):
        check_params(params)
        self._shape = camera.height, camera.width
        self._seed, self._params = seed, params
        self._shadow_px_m = camera.fx * params.shadow_baseline_m
        self._columns = np.tile(np.arange(camera.width, dtype=np.float32), (camera.height, 1))
        self._depth_mm = _depth_table(params)
        field_shape = camera.height + SPARE_PX, camera.width + SPARE_PX
        random = np.random.RandomState(seed)
        self._noise = _noise_field(field_shape, params, random)
        self._holes = _hole_field(field_shape, params, random)
        if params.jitter_px > 0:
            self._grid = np.stack(np.meshgrid(*(np.arange(size, dtype=np.int16) for size in self._shape[::-1])), -1)
            self._jitter = _jitter_field(field_shape, params, random)

    def measure(self, inverse_depth, number):
        """The depth image of one frame: a function of seed, number and scene only, whatever was measured before.

        Parameters
        ----------
        inverse_depth : numpy.ndarray, (height, width), float32
            1/m along z; 0 where there is nothing.
        number : int
            0 to 2**32 - 1; frames with different numbers have independent noise.

        Returns
        -------
        numpy.ndarray, (height, width), uint16
            Millimetres, 0 = no depth.

        Raises
        ------
        ValueError
            If the inverse depth has another shape or type, or the number is out of range.
        """
        if inverse_depth.shape != self._shape or inverse_depth.dtype != np.float32:
            raise ValueError('inverse depth is %s %s; float32 %s expected'
                             % (inverse_depth.dtype, inverse_depth.shape, self._shape))
        random = np.random.RandomState([self._seed, number])
        noise, holes, jitter = (self._cut(random) for _ in range(3))
        if self._params.jitter_px > 0:
            inverse_depth = self._ragged(inverse_depth, jitter)
        # Rounds to the nearest step, and what is too large or no number becomes a level that the table calls 0.
        level = cv2.addWeighted(inverse_depth, self._params.focal_baseline_px_m * self._params.steps_per_px,
                                self._noise[noise], 1, 0, dtype=cv2.CV_16U)
        depth_mm = self._depth_mm[level]
        depth_mm[cv2.bitwise_or(self._shadow(inverse_depth), self._holes[holes]) > 0] = 0
        return depth_mm

    def _cut(self, random):
        """A random place in the fields, of the size of the image: slices of rows and columns."""
        top, left = random.randint(0, SPARE_PX + 1, 2)
        return slice(top, top + self._shape[0]), slice(left, left + self._shape[1])

    def _ragged(self, inverse_depth, place):
        """The scene with ragged silhouettes, and with flying pixels: those between near and far."""
        whole, fraction = (field[place] for field in self._jitter)
        return cv2.remap(inverse_depth, cv2.add(self._grid, whole), fraction, cv2.INTER_LINEAR,
                         borderMode=cv2.BORDER_REPLICATE)

    def _shadow(self, inverse_depth):
        """255 where the second imager, to the right of the first, sees something nearer instead of the pixel."""
        second = cv2.scaleAdd(inverse_depth, -self._shadow_px_m, self._columns)
        leftmost = np.minimum.accumulate(second[:, ::-1], axis=1)[:, ::-1]  # of all pixels from here to the right
        hidden = cv2.compare(second, leftmost + np.float32(HIDDEN_BY_PX), cv2.CMP_GT)
        kernel = np.ones((1, self._params.shadow_extra_px + 1), np.uint8)
        return cv2.dilate(hidden, kernel, anchor=(0, 0))  # to the left


def check_params(params):
    """Raise ValueError, naming the value, where a parameter makes no sense."""
    for name, value in zip(params._fields, params):
        if not 0 <= value < np.inf:
            raise ValueError('%s is %g; a number from 0 on expected' % (name, value))
    for name in ('focal_baseline_px_m', 'steps_per_px', 'nearest_px'):
        if getattr(params, name) == 0:
            raise ValueError('%s is 0; more expected' % name)
    if params.nearest_px <= params.farthest_px:
        raise ValueError('nearest_px is %g; more than farthest_px, %g, expected'
                         % (params.nearest_px, params.farthest_px))
    if params.hole_share > 1:
        raise ValueError('hole_share is %g; 0 to 1 expected' % params.hole_share)


def _depth_table(params):
    """Depth in millimetres of each level, (65536,), uint16; 0 out of range, and where it is more than 16 bits hold."""
    level = np.arange(1, 1 << 16)
    depth_mm = np.rint(1000. * params.focal_baseline_px_m * params.steps_per_px / level)
    disparity_px = level / float(params.steps_per_px)
    measured = (disparity_px >= params.farthest_px) & (disparity_px <= params.nearest_px) & (depth_mm < 1 << 16)
    return np.append(0, np.where(measured, depth_mm, 0)).astype(np.uint16)


def _noise_field(shape, params, random):
    """Noise of disparity, steps, float32."""
    noise_px = _correlated(shape, params.noise_kernel_px, random) * params.noise_px
    noise_px += random.standard_normal(shape) * params.white_noise_px
    return noise_px.astype(np.float32) * np.float32(params.steps_per_px)


def _hole_field(shape, params, random):
    """255 in the holes, uint8."""
    field = _correlated(shape, params.hole_kernel_px, random)
    return (field > np.percentile(field, 100 * (1 - params.hole_share))).astype(np.uint8) * 255


def _jitter_field(shape, params, random):
    """Displacements of pixels in the form that cv2.remap is fastest with: whole pixels (..., 2), and fractions."""
    x, y = ((_correlated(shape, params.jitter_kernel_px, random) * params.jitter_px).astype(np.float32)
            for _ in range(2))
    return cv2.convertMaps(x, y, cv2.CV_16SC2)


def _correlated(shape, kernel_px, random):
    """Gaussian noise of sigma 1, float64, correlated over the image by a Gaussian of sigma `kernel_px`."""
    margin = int(np.ceil(4 * kernel_px))
    kernel = cv2.getGaussianKernel(2 * margin + 1, kernel_px) if margin else np.ones((1, 1))
    white = random.standard_normal(tuple(size + 2 * margin for size in shape))
    smooth = cv2.sepFilter2D(white, cv2.CV_64F, kernel, kernel) / (kernel ** 2).sum()
    return smooth[margin:margin + shape[0], margin:margin + shape[1]]
