"""Compressed images as image_transport_plugins publish them."""
import struct

import cv2
import numpy as np
from sensor_msgs.msg import CompressedImage

from ros_3d_bb.conversions.image_msgs import pixels_from

QUANTIZATION, MAX_M = 100.0, 10.0  # defaults of the compressed_depth_image_transport
JPEG_QUALITY = [cv2.IMWRITE_JPEG_QUALITY, 80]  # default of the compressed_image_transport


def compressed(message, codec):
    """The CompressedImage of an image: jpeg, png, or of depth compressedDepth."""
    pixels, encoding = pixels_from(message)
    if codec.startswith('compressedDepth'):
        text, data = '%s; %s' % (encoding, codec), compressed_depth(pixels)
    else:
        is_color = pixels.ndim == 3
        text = '%s; %s compressed %s' % (encoding, codec, 'bgr8' if is_color else '')
        _done, data = cv2.imencode('.' + codec, pixels[..., ::-1] if encoding == 'rgb8' else pixels, JPEG_QUALITY)
        data = data.tobytes()
    return CompressedImage(message.header, text, data)


def compressed_depth(pixels):
    """Depth in millimetres, uint16, or in metres, float32, with the header of the transport."""
    a, b = 0.0, 0.0
    if pixels.dtype.kind == 'f':
        a = QUANTIZATION * (QUANTIZATION + 1)
        b = 1 - a / MAX_M
        with np.errstate(all='ignore'):
            pixels = np.where((pixels > 0) & (pixels < MAX_M), a / pixels + b, 0).astype(np.uint16)
    return struct.pack('<iff', 0, a, b) + cv2.imencode('.png', pixels)[1].tobytes()
