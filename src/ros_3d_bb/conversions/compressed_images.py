"""Decoding of sensor_msgs/CompressedImage: JPEG, PNG, and depth of the compressed_depth_image_transport (PNG).

The declared size is checked before anything is decoded. OpenCV is imported where it is used, see `camera.distortion`.
"""
import struct
from typing import Tuple

import numpy as np

JPEG, PNG = b'\xff\xd8', b'\x89PNG\r\n\x1a\n'  # first bytes
JPEG_END, PNG_END = b'\xff\xd9', b'IEND'
PNG_GREY = 0  # colour type
MAX_PIXELS = 2 ** 25  # an image of 8K video has 33 million pixels
DEPTH_TRANSPORT, RVL = 'compressedDepth', 'rvl'
DEPTH_HEADER = struct.Struct('<iff')  # ConfigHeader of the transport: format (unused), depthQuantA, depthQuantB


def decode(format_text: str, data: bytes) -> Tuple[np.ndarray, str]:
    """Return the pixels, (height, width[, channels]), of a compressed image and their encoding as in sensor_msgs/Image.

    Raises ValueError if the data are not JPEG, PNG or compressed depth, are damaged, or have too many pixels.
    """
    encoding, _separator, codec = format_text.partition(';')
    encoding, data = encoding.strip(), bytes(data)
    if DEPTH_TRANSPORT in format_text:
        if RVL in codec:
            raise ValueError('its depth is compressed by RVL; set the format of the publisher to png')
        return _decode_depth(encoding, data)
    width, height, is_grey16 = _declared(data)
    _check_size(width, height)
    if is_grey16:
        return _decode_with_opencv(data, True), encoding if encoding.startswith('bayer_') else '16UC1'
    if encoding.startswith('bayer_'):
        return _decode_with_opencv(data, True), encoding
    return _decode_with_opencv(data, False), 'bgr8'


def _declared(data: bytes) -> Tuple[int, int, bool]:
    """Return the width and height in the header of a complete JPEG or PNG, and whether it is 16-bit grey."""
    if data.startswith(JPEG):
        width, height = _jpeg_size(data)
        is_grey16, is_complete = False, data.rfind(JPEG_END) > 0
    elif data.startswith(PNG) and len(data) >= 26:
        width, height, bits, color_type = struct.unpack_from('>IIBB', data, 16)
        is_grey16, is_complete = (bits, color_type) == (16, PNG_GREY), data.rfind(PNG_END) > 0
    else:
        raise ValueError('its %d bytes are neither JPEG nor PNG' % len(data))
    if not is_complete:
        raise ValueError('its %d bytes are truncated' % len(data))
    return width, height, is_grey16


def _jpeg_size(data: bytes) -> Tuple[int, int]:
    """Return the width and height in the first frame header of a JPEG. Stops at markers that cannot precede it."""
    at = len(JPEG)
    while at + 9 <= len(data) and data[at] == 0xff:
        marker, (length,) = data[at + 1], struct.unpack_from('>H', data, at + 2)
        if marker == 0xff:  # padding
            at += 1
        elif marker < 0xc0 or 0xd0 <= marker <= 0xda:
            break
        elif marker <= 0xcf and marker not in (0xc4, 0xc8, 0xcc):
            return struct.unpack_from('>HH', data, at + 5)[::-1]
        else:
            at += 2 + length
    raise ValueError('the header of its JPEG is damaged')


def _check_size(width: int, height: int) -> None:
    if not 0 < width * height <= MAX_PIXELS:
        raise ValueError('it has %d x %d pixels; 1 to %d pixels expected' % (width, height, MAX_PIXELS))


def _decode_with_opencv(data: bytes, unchanged: bool) -> np.ndarray:
    import cv2
    flags = cv2.IMREAD_UNCHANGED if unchanged else cv2.IMREAD_COLOR | cv2.IMREAD_IGNORE_ORIENTATION
    try:
        pixels = cv2.imdecode(np.frombuffer(data, np.uint8), flags)
    except cv2.error as error:
        raise ValueError('OpenCV cannot decode its %d bytes (%s)' % (len(data), error.err))
    if pixels is None:
        raise ValueError('its %d bytes are damaged' % len(data))
    if unchanged and pixels.ndim != 2:
        raise ValueError('it has %d channels; 1 expected' % pixels.shape[2])
    return pixels


def _decode_depth(encoding: str, data: bytes) -> Tuple[np.ndarray, str]:
    """Decode a message of the compressed_depth_image_transport: its header, then 16-bit values as PNG.

    Depth in metres, 32FC1, is stored as inverse depth: depth = A / (value - B), and 0 if it is not measured.
    """
    if encoding not in ('16UC1', 'mono16', '32FC1'):
        raise ValueError('its encoding is %.20r; 16UC1 or 32FC1 expected' % encoding)
    if len(data) < DEPTH_HEADER.size:
        raise ValueError('its %d bytes are truncated' % len(data))
    _format, quant_a, quant_b = DEPTH_HEADER.unpack_from(data)
    content = data[DEPTH_HEADER.size:]
    width, height, is_grey16 = _declared(content)
    _check_size(width, height)
    if not is_grey16:
        raise ValueError('it does not contain a 16-bit grey PNG')
    values = _decode_with_opencv(content, True)
    if encoding != '32FC1':
        return values, '16UC1'
    if not (np.isfinite(quant_b) and np.isfinite(quant_a) and quant_a > 0):
        raise ValueError('its quantization is %g, %g; finite numbers expected, the first one positive'
                         % (quant_a, quant_b))
    with np.errstate(divide='ignore', over='ignore'):
        depth_m = np.float32(quant_a) / (values - np.float32(quant_b))
    depth_m[values == 0] = np.nan
    return depth_m, '32FC1'
