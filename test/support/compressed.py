"""Compressed images as image_transport_plugins publish them."""
import struct

import cv2
import numpy as np
from sensor_msgs.msg import CompressedImage

from ros_3d_bb.conversions.image_msgs import pixels_from

QUANTIZATION, MAX_M = 100.0, 10.0  # defaults of the compressed_depth_image_transport
JPEG_QUALITY = [cv2.IMWRITE_JPEG_QUALITY, 80]  # default of the compressed_image_transport


def compressed(message, codec):
    """The CompressedImage of an image: jpeg, png, or of depth compressedDepth, compressedDepth rvl."""
    pixels, encoding = pixels_from(message)
    if codec.startswith('compressedDepth'):
        text, data = '%s; %s' % (encoding, codec), compressed_depth(pixels, 'rvl' in codec)
    else:
        is_color = pixels.ndim == 3
        text = '%s; %s compressed %s' % (encoding, codec, 'bgr8' if is_color else '')
        _done, data = cv2.imencode('.' + codec, pixels[..., ::-1] if encoding == 'rgb8' else pixels, JPEG_QUALITY)
        data = data.tobytes()
    return CompressedImage(message.header, text, data)


def compressed_depth(pixels, is_rvl=False):
    """Depth in millimetres, uint16, or in metres, float32, with the header of the transport."""
    a, b = 0.0, 0.0
    if pixels.dtype.kind == 'f':
        a = QUANTIZATION * (QUANTIZATION + 1)
        b = 1 - a / MAX_M
        with np.errstate(all='ignore'):
            pixels = np.where((pixels > 0) & (pixels < MAX_M), a / pixels + b, 0).astype(np.uint16)
    return struct.pack('<iff', 0, a, b) + (rvl(pixels) if is_rvl else cv2.imencode('.png', pixels)[1].tobytes())


def rvl(pixels):
    """RVL, written pixel by pixel, with the size in front."""
    values, nibbles, at, previous = pixels.ravel().tolist(), [], 0, 0

    def write(number):
        while number > 7:
            nibbles.append(number & 7 | 8)
            number >>= 3
        nibbles.append(number)
    while at < len(values):
        begin = at
        while at < len(values) and values[at] == 0:
            at += 1
        write(at - begin)
        end = at
        while end < len(values) and values[end]:
            end += 1
        write(end - at)
        for value in values[at:end]:
            difference = value - previous
            write(2 * difference if difference >= 0 else -2 * difference - 1)
            previous = value
        at = end
    nibbles += [0] * (-len(nibbles) % 8)
    words = [int(''.join('%x' % nibble for nibble in nibbles[start:start + 8]), 16)
             for start in range(0, len(nibbles), 8)]
    return struct.pack('<II%dI' % len(words), pixels.shape[1], pixels.shape[0], *words)
