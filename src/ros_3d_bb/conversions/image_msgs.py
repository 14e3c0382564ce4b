"""Conversion between image messages and numpy, without copies if the layout allows it.

cv_bridge is not used, because it has no Python 3 build on Melodic and does not check the size of the data. The
functions accept any object with the fields of sensor_msgs/Image or sensor_msgs/CompressedImage and do not import ROS.
OpenCV is imported only where it is used, see `camera.distortion`.
"""
from typing import Any, Optional, Sequence, Tuple

import numpy as np

from ros_3d_bb.camera.images import DepthImage
from ros_3d_bb.conversions.compressed_images import decode

# encoding: (dtype without byte order, channels)
LAYOUTS = {'rgb8': ('u1', 3), 'bgr8': ('u1', 3), 'rgba8': ('u1', 4), 'bgra8': ('u1', 4), 'mono8': ('u1', 1),
           '8UC1': ('u1', 1), '8UC3': ('u1', 3), '16UC1': ('u2', 1), 'mono16': ('u2', 1), '32FC1': ('f4', 1),
           'yuv422': ('u1', 2), 'yuv422_yuy2': ('u1', 2)}
# Encodings that cv2.cvtColor converts, and how. OpenCV names a Bayer pattern by pixels of its second row.
CONVERSIONS = {'yuv422': 'COLOR_YUV2RGB_UYVY', 'yuv422_yuy2': 'COLOR_YUV2RGB_YUY2',
               'bayer_rggb8': 'COLOR_BayerBG2RGB', 'bayer_rggb16': 'COLOR_BayerBG2RGB',
               'bayer_bggr8': 'COLOR_BayerRG2RGB', 'bayer_bggr16': 'COLOR_BayerRG2RGB',
               'bayer_gbrg8': 'COLOR_BayerGR2RGB', 'bayer_gbrg16': 'COLOR_BayerGR2RGB',
               'bayer_grbg8': 'COLOR_BayerGB2RGB', 'bayer_grbg16': 'COLOR_BayerGB2RGB'}
LAYOUTS.update((encoding, ('u2' if encoding.endswith('16') else 'u1', 1))
               for encoding in CONVERSIONS if encoding.startswith('bayer_'))
COLOR_ENCODINGS = ('rgb8', 'bgr8', 'rgba8', 'bgra8', 'mono8', '8UC1', '8UC3') + tuple(CONVERSIONS)
# REP 118: depth is in millimetres in 16UC1 (mono16 in Gazebo and some drivers) and in metres in 32FC1.
DEPTH_SCALES = {'16UC1': 0.001, 'mono16': 0.001, '32FC1': 1.0}
COMPRESSED_DEPTH = ', as on a topic that ends in /compressedDepth: JPEG changes depth'
GRID = 16  # rows and columns of the grid of pixels whose median shows the unit of depth
LEAST_SAMPLES = 8  # with fewer valid pixels the unit is not checked
NEAREST_M, FARTHEST_M = 0.1, 100.0  # plausible range of the median


def array_from(message: Any) -> np.ndarray:
    """Return the pixels, (height, width[, channels]), of an image message as a read-only view of its data.

    Raises ValueError if the encoding is unknown, the size is zero, or the data are shorter than the size requires.
    """
    if message.encoding not in LAYOUTS:
        raise ValueError('image encoding %r is unknown; expected one of %s' % (message.encoding, ', '.join(LAYOUTS)))
    kind, channels = LAYOUTS[message.encoding]
    dtype = np.dtype(('>' if message.is_bigendian else '<') + kind)
    row_bytes = message.width * channels * dtype.itemsize
    if row_bytes == 0 or message.height == 0:
        raise ValueError('image is empty: %d x %d pixels' % (message.width, message.height))
    if message.step < row_bytes or len(message.data) < message.step * (message.height - 1) + row_bytes:
        raise ValueError('image data is too short: %d bytes in rows of %d, for %d x %d pixels of %s'
                         % (len(message.data), message.step, message.width, message.height, message.encoding))
    pixel_bytes = channels * dtype.itemsize
    strides = message.step, pixel_bytes, dtype.itemsize
    pixels: np.ndarray = np.ndarray((message.height, message.width, channels), dtype, message.data, 0, strides)
    return pixels[..., 0] if channels == 1 else pixels


def pixels_from(message: Any, encodings: Sequence[str] = tuple(LAYOUTS),
                content: str = 'supported') -> Tuple[np.ndarray, str]:
    """Return the pixels, (height, width[, channels]), of an image message, which may be compressed, and their encoding.

    Raises ValueError as `array_from`, if a compressed image cannot be decoded, or if the encoding is not one of
    `encodings`, those of the expected `content`.
    """
    if not is_compressed(message):
        if message.encoding not in encodings:
            raise ValueError('%s image has encoding %r; expected one of %s'
                             % (content, message.encoding, ', '.join(encodings)))
        return array_from(message), message.encoding
    name = 'sensor_msgs/CompressedImage of format %.60r' % message.format
    try:
        pixels, encoding = decode(message.format, message.data)
    except ValueError as error:
        raise ValueError('%s cannot be decoded: %s' % (name, error))
    if encoding not in encodings:
        raise ValueError('%s has encoding %.20r; a %s image expected%s' % (name, encoding, content, COMPRESSED_DEPTH
                                                                           if content == 'depth' else ''))
    return pixels, encoding


def is_compressed(message: Any) -> bool:
    return hasattr(message, 'format')


def imgmsg_to_rgb(message: Any) -> np.ndarray:
    """Return the pixels of a colour image message as RGB, (height, width, 3), uint8; a view if the encoding allows it.

    Raises ValueError as `pixels_from`, and if the encoding is not colour or grey.
    """
    pixels, encoding = pixels_from(message, COLOR_ENCODINGS, 'colour')
    if encoding in CONVERSIONS:
        return _converted(pixels, encoding)
    if pixels.ndim == 2:
        return np.repeat(pixels[..., None], 3, axis=2)
    return pixels[..., 2::-1] if encoding in ('bgr8', 'bgra8', '8UC3') else pixels[..., :3]


def _converted(pixels: np.ndarray, encoding: str) -> np.ndarray:
    """Return YUV or Bayer pixels as RGB. Of 16 bits the higher 8 are used."""
    import cv2
    if pixels.dtype.itemsize == 2:
        pixels = (pixels >> 8).astype(np.uint8)
    try:
        return cv2.cvtColor(np.ascontiguousarray(pixels), getattr(cv2, CONVERSIONS[encoding]))
    except cv2.error as error:
        raise ValueError('image of %d x %d pixels cannot be converted from %s (%s)'
                         % (pixels.shape[1], pixels.shape[0], encoding, error.err))


def imgmsg_to_depth(message: Any, scale_m: Optional[float] = None, check_unit: bool = False) -> DepthImage:
    """Convert an image message to a DepthImage.

    Raises ValueError as `pixels_from`, if the encoding is not a depth encoding, and with `check_unit` as `units_fault`.
    `scale_m` is given in metres per unit, for a camera that does not follow REP 118.
    """
    pixels, encoding = pixels_from(message, tuple(DEPTH_SCALES), 'depth')
    depth = DepthImage(pixels, scale_m or DEPTH_SCALES[encoding])
    fault = units_fault(depth) if check_unit else ''
    if fault:
        raise ValueError(fault)
    return depth


def units_fault(depth: DepthImage) -> str:
    """Return a sentence if the median of a few hundred pixels of a DepthImage indicates a wrong unit, '' otherwise."""
    values = depth.values[::max(1, depth.values.shape[0] // GRID), ::max(1, depth.values.shape[1] // GRID)]
    valid = values[np.isfinite(values) & (values > 0)]
    if valid.size < LEAST_SAMPLES:
        return ''
    lower, upper = np.sort(valid)[[(valid.size - 1) // 2, valid.size // 2]].tolist()  # np.median takes much longer
    median_m = (lower + upper) / 2 * depth.scale_m
    if NEAREST_M <= median_m <= FARTHEST_M:
        return ''
    integers = depth.values.dtype.kind == 'u'
    unit, scale_m = ('metres', 1) if median_m < NEAREST_M else ('millimetres', 0.001)
    return ('the depth image has the wrong unit: half of its pixels are nearer than %.3g m; its values seem to be %s '
            'in a %s image, whose unit is %s (REP 118): fix the driver, or set ~depth_scale: %g'
            % (median_m, unit, '16UC1' if integers else '32FC1', 'millimetres' if integers else 'metres',
               scale_m))


def fill_image(message: Any, pixels: np.ndarray, encoding: str) -> Any:
    """Write pixels (height, width[, channels]) to an image message, except for its header. Returns the message.

    Raises ValueError if the pixels do not have the type and channels of the encoding.
    """
    kind, channels = LAYOUTS[encoding]
    if pixels.dtype.newbyteorder('=') != np.dtype(kind) or pixels.shape[2:] != ((channels,) if channels > 1 else ()):
        raise ValueError('pixels of type %s and shape %s are not %s' % (pixels.dtype, pixels.shape, encoding))
    message.height, message.width = pixels.shape[:2]
    message.encoding, message.is_bigendian = encoding, 0
    message.step = message.width * channels * pixels.dtype.itemsize
    message.data = np.ascontiguousarray(pixels, pixels.dtype.newbyteorder('<')).tobytes()
    return message
