"""Pictures of the documentation: the animation that doc/demo_pictures.py writes. `./run pictures` makes them all."""
import importlib.util
import os

import numpy as np
import pytest

from support.pages import DOC


@pytest.fixture
def demo_pictures():
    specification = importlib.util.spec_from_file_location('demo_pictures', os.path.join(DOC, 'demo_pictures.py'))
    module = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(module)
    return module


def test_the_animation_shows_each_frame(demo_pictures, tmp_path):
    """A square moves on noise: only its pixels change in the file, and no trace of it remains."""
    width, height = 2 * demo_pictures.PANEL_PX[0], 40
    noise = np.random.RandomState(0).randint(0, demo_pictures.SAME_LEVELS[1], (12, height, width, 3))
    frames = [np.array(100 + level, np.uint8) for level in noise]
    for number, frame in enumerate(frames):
        frame[10:20, 30 * number:30 * number + 10] = 250, 20, 20
        frame[10:20, width // 2 + 30 * number:width // 2 + 30 * number + 10] = 20, 250, 20
    demo_pictures.write_gif(frames, str(tmp_path / 'a.gif'), 0.1)
    with demo_pictures.Image.open(str(tmp_path / 'a.gif')) as animation:
        assert animation.n_frames == 12 and animation.info['duration'] == 100
        for number, frame in enumerate(frames):
            animation.seek(number)
            shown = np.asarray(animation.convert('RGB')).astype(int)
            assert np.abs(shown - frame).max() <= 20
    assert (tmp_path / 'a.gif').stat().st_size < 12 * 4000


def test_explanations_point_at_what_rviz_shows(demo_pictures):
    """RViz looks at the focus, along x of the map: a point above is above, one to the left in the map (y) is left."""
    width, height = demo_pictures.RVIZ_PX
    focus = np.array(demo_pictures.FOCUS_M)
    assert demo_pictures.pixel_of(focus) == pytest.approx((width / 2, height / 2))
    assert demo_pictures.pixel_of(focus + [0, 0, 0.5])[1] < height / 2 - 20
    assert demo_pictures.pixel_of(focus + [0, 0.5, 0])[0] < width / 2 - 20


def test_the_animation_of_the_readme_is_small():
    assert os.path.getsize(os.path.join(DOC, 'images', 'demo.gif')) < 3e6
