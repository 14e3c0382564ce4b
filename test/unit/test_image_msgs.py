from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, strategies as st

from ros_3d_bb.conversions.image_msgs import LAYOUTS, array_from, imgmsg_to_depth, imgmsg_to_rgb

IMAGES = st.builds(SimpleNamespace, width=st.integers(0, 2 ** 32 - 1) | st.integers(0, 9),
                   height=st.integers(0, 2 ** 32 - 1) | st.integers(0, 9),
                   step=st.integers(0, 2 ** 32 - 1) | st.integers(0, 40),
                   encoding=st.sampled_from(sorted(LAYOUTS)) | st.text(),
                   is_bigendian=st.integers(0, 255), data=st.integers(0, 400).map(bytes))


def message_of(pixels, encoding, padding=0, big_endian=False):
    """Duck-typed image message with padding bytes after each row."""
    pixels = pixels.astype(pixels.dtype.newbyteorder('>' if big_endian else '<'))
    rows = [row.tobytes() + b'\xee' * padding for row in pixels]
    return SimpleNamespace(height=pixels.shape[0], width=pixels.shape[1], encoding=encoding,
                           is_bigendian=int(big_endian), step=len(rows[0]), data=b''.join(rows))


@given(st.integers(1, 9), st.integers(1, 9), st.integers(0, 5), st.booleans(),
       st.sampled_from([('16UC1', np.uint16), ('32FC1', np.float32), ('mono16', np.uint16)]))
def test_any_row_step_and_byte_order(height, width, padding, big_endian, layout):
    encoding, dtype = layout
    pixels = (np.arange(height * width).reshape(height, width) * 257 % 65521).astype(dtype)
    depth = imgmsg_to_depth(message_of(pixels, encoding, padding, big_endian))
    np.testing.assert_array_equal(depth.values, pixels)
    assert depth.scale_m == (1.0 if encoding == '32FC1' else 0.001)
    assert imgmsg_to_depth(message_of(pixels, encoding), 0.00025).scale_m == 0.00025


@pytest.mark.parametrize('encoding,channels', [('rgb8', [0, 1, 2]), ('bgr8', [2, 1, 0]), ('rgba8', [0, 1, 2]),
                                               ('bgra8', [2, 1, 0]), ('mono8', [0, 0, 0])])
def test_colours_are_converted_to_rgb(encoding, channels):
    depth = 1 if encoding == 'mono8' else 4 if 'a' in encoding else 3
    pixels = np.random.RandomState(0).randint(0, 256, (4, 5, depth)).astype(np.uint8)
    rgb = imgmsg_to_rgb(message_of(pixels[..., 0] if depth == 1 else pixels, encoding, padding=3))
    np.testing.assert_array_equal(rgb, pixels[..., channels])


# Colour of the pixels of each Bayer pattern: rows of the upper left 2 x 2 pixels, R 0, G 1, B 2.
BAYER = {'rggb': [[0, 1], [1, 2]], 'bggr': [[2, 1], [1, 0]], 'gbrg': [[1, 2], [0, 1]], 'grbg': [[1, 0], [2, 1]]}


@pytest.mark.parametrize('pattern', sorted(BAYER))
@pytest.mark.parametrize('bits, big_endian', [(8, False), (16, False), (16, True)])
def test_bayer_patterns_are_converted_to_rgb(pattern, bits, big_endian):
    color = np.array([200, 120, 40])
    mosaic = color[np.tile(BAYER[pattern], (4, 5))].astype(np.uint8 if bits == 8 else np.uint16) << (bits - 8)
    rgb = imgmsg_to_rgb(message_of(mosaic, 'bayer_%s%d' % (pattern, bits), 3, big_endian))
    np.testing.assert_array_equal(rgb, np.broadcast_to(color, (8, 10, 3)))


@pytest.mark.parametrize('encoding, of_luma', [('yuv422', 1), ('yuv422_yuy2', 0)])
def test_yuv_is_converted_to_rgb(encoding, of_luma):
    """Red: U 90, V 240, luma 81; the right half is darker."""
    pixels = np.empty((4, 8, 2), np.uint8)
    pixels[:, ::2, 1 - of_luma], pixels[:, 1::2, 1 - of_luma] = 90, 240
    pixels[:, :4, of_luma], pixels[:, 4:, of_luma] = 81, 41
    rgb = imgmsg_to_rgb(message_of(pixels, encoding, padding=4)).astype(int)
    assert np.abs(rgb[:, :4] - [254, 0, 0]).max() <= 2 and np.abs(rgb[:, 4:, 0] - 208).max() <= 3


@pytest.mark.parametrize('read,encoding', [(imgmsg_to_depth, 'rgb8'), (imgmsg_to_rgb, '16UC1')])
def test_colour_is_rejected_as_depth_and_depth_as_colour(read, encoding):
    with pytest.raises(ValueError, match=repr(encoding)):
        read(SimpleNamespace(encoding=encoding))


@given(IMAGES)
def test_an_image_is_readable_or_rejected(message):
    for read in (array_from, imgmsg_to_rgb, lambda image: imgmsg_to_depth(image).values):
        try:
            pixels = read(message)
        except ValueError:
            continue
        assert pixels.shape[:2] == (message.height, message.width)
        pixels.sum()  # each of them can be read
