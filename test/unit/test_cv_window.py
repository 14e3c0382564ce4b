"""Keys of the viewer's window."""
import pytest

from ros_3d_bb.visualization.cv_window import character_of

SHIFT, CAPS_LOCK, LEFT, DELETE, NUM_LOCK = 0xffe1, 0xffe5, 0xff51, 0xffff, 0xff7f
WITH_SHIFT = 1 << 16  # GTK's state of modifiers


@pytest.mark.parametrize('code, character', [
    (ord('a'), 'a'), (ord('A') | WITH_SHIFT, 'A'), (0xf6, 'ö'), (0xd6 - 256, 'ö'), (0xff08, '\b'), (0xff8d, '\r'),
    (0xffb7, '7'), (27, '\x1b')])
def test_keys_with_a_character_give_it(code, character):
    assert character_of(code) == character


@pytest.mark.parametrize('code', [-1, SHIFT, SHIFT | WITH_SHIFT, CAPS_LOCK, LEFT, DELETE, NUM_LOCK])
def test_other_keys_give_none(code):
    assert character_of(code) == ''
