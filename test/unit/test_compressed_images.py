import struct
import zlib
from types import SimpleNamespace

import cv2
import numpy as np
import pytest

from ros_3d_bb.conversions.compressed_images import PNG
from ros_3d_bb.conversions.image_msgs import imgmsg_to_depth, imgmsg_to_rgb
from support.compressed import compressed_depth

SMOOTH = np.add.outer(np.arange(48), np.arange(64)).astype(np.uint8)[..., None] + np.array([0, 40, 80], np.uint8)
DEPTH_MM = (1000 + 40 * np.add.outer(np.arange(48), np.arange(64))).astype(np.uint16)
DEPTH_MM[:5, 3:9], DEPTH_MM[-1, -1] = 0, 65535
DEPTH_M = np.where(DEPTH_MM > 9000, np.nan, DEPTH_MM * 0.001).astype(np.float32)
DEPTH, QUANTIZED = '16UC1; compressedDepth', '32FC1; compressedDepth'


def message_of(format_text, data):
    return SimpleNamespace(format=format_text, data=data)


def encoded(name, pixels):
    return cv2.imencode(name, pixels)[1].tobytes()


@pytest.mark.parametrize('format_text, name, largest', [
    ('rgb8; jpeg compressed bgr8', '.jpg', 6), ('bgr8; png compressed bgr8', '.png', 0), ('jpeg', '.jpg', 6),
    ('png', '.png', 0)])
def test_colour_is_decoded_to_rgb(format_text, name, largest):
    rgb = imgmsg_to_rgb(message_of(format_text, encoded(name, SMOOTH[..., ::-1])))
    assert rgb.dtype == np.uint8 and np.abs(rgb.astype(int) - SMOOTH).max() <= largest
    grey = imgmsg_to_rgb(message_of('mono8; png compressed ', encoded('.png', SMOOTH[..., 0])))
    np.testing.assert_array_equal(grey, SMOOTH[..., [0, 0, 0]])


@pytest.mark.parametrize('format_text, data', [
    (DEPTH, compressed_depth(DEPTH_MM)), (DEPTH + ' png', compressed_depth(DEPTH_MM)),
    ('mono16; compressedDepth', compressed_depth(DEPTH_MM)),
    ('16UC1; png compressed ', encoded('.png', DEPTH_MM))], ids=range(4))
def test_depth_in_millimetres_is_exact(format_text, data):
    depth = imgmsg_to_depth(message_of(format_text, data))
    np.testing.assert_array_equal(depth.values, DEPTH_MM)
    assert depth.scale_m == 0.001


def test_depth_in_metres_has_the_error_of_its_quantization():
    depth = imgmsg_to_depth(message_of(QUANTIZED, compressed_depth(DEPTH_M)))
    measured = DEPTH_M > 0
    np.testing.assert_array_equal(np.isfinite(depth.values), measured)
    assert np.all(np.abs(depth.values - DEPTH_M)[measured] <= 1.01 * DEPTH_M[measured] ** 2 / 10100)
    assert depth.scale_m == 1.0 and depth.values.dtype == np.float32


def png_declaring(width, height):
    """A complete PNG header of any size without pixels."""
    def chunk(name, content):
        return struct.pack('>I', len(content)) + name + content + struct.pack('>I', zlib.crc32(name + content))
    return (PNG + chunk(b'IHDR', struct.pack('>IIBBBBB', width, height, 16, 0, 0, 0, 0))
            + chunk(b'IDAT', zlib.compress(bytes(1000))) + chunk(b'IEND', b''))


def jpeg_declaring(width, height):
    data = bytearray(encoded('.jpg', SMOOTH))
    at = data.index(b'\xff\xc0')
    data[at + 5:at + 9] = struct.pack('>HH', height, width)
    return bytes(data)


JPEG_BYTES, PNG_BYTES, DEPTH_BYTES = encoded('.jpg', SMOOTH), encoded('.png', SMOOTH), compressed_depth(DEPTH_MM)
QUANTIZED_BYTES = compressed_depth(DEPTH_M)
COLORS = [('rgb8; jpeg compressed bgr8', data, word) for data, word in (
    (b'GIF89a' + bytes(99), 'neither'), (JPEG_BYTES[:len(JPEG_BYTES) // 2], 'truncated'),
    (PNG_BYTES[:60] + bytes(9) + PNG_BYTES[69:], 'damaged'), (jpeg_declaring(65500, 65500), '65500 x 65500'),
    (png_declaring(2 ** 31 - 1, 2 ** 31 - 1), '2147483647'), (encoded('.png', DEPTH_MM), "encoding '16UC1'"))]
DEPTHS = [(DEPTH, b'', 'truncated'), (DEPTH, bytes(12) + PNG_BYTES, '16-bit'),
          (DEPTH, bytes(12) + png_declaring(60000, 60000), '60000 x 60000'),
          (QUANTIZED, struct.pack('<iff', 0, float('nan'), 0) + QUANTIZED_BYTES[12:], 'quantization'),
          ('8UC1; compressedDepth', DEPTH_BYTES, 'encoding'), (DEPTH + ' rvl', DEPTH_BYTES, 'png'),
          ('16UC1; jpeg compressed ', JPEG_BYTES, 'depth')]
CASES = [(imgmsg_to_rgb,) + case for case in COLORS] + [(imgmsg_to_depth,) + case for case in DEPTHS]


@pytest.mark.parametrize('read, format_text, data, word', CASES, ids=range(len(CASES)))
def test_unusable_data_are_rejected_by_type_and_format(read, format_text, data, word):
    with pytest.raises(ValueError) as caught:
        read(message_of(format_text, data))
    text = str(caught.value)
    assert 'sensor_msgs/CompressedImage' in text and repr(format_text) in text and word in text
