"""Content of the image of a report."""
import numpy as np

from ros_3d_bb_lab.evaluation.demo.scene_plot import TRACK_COLORS, TRUTH_COLOR, Paths, scene_picture, top_view


def has(image, color):
    return bool((image == color).all(axis=-1).any())


def test_the_top_view_shows_truth_tracks_and_robot():
    paths = Paths({1: [(2, 1), (4, 1)]}, {3: [(2, -1), (4, -1)]}, np.array([(0, 0), (1, 0)]))
    image = top_view(paths)
    truth, track = ((image == color).all(axis=-1) for color in (TRUTH_COLOR, TRACK_COLORS[3]))
    assert truth.any() and track.any() and has(image, (20, 20, 20))
    assert np.nonzero(truth)[0].mean() < np.nonzero(track)[0].mean()  # y points up


def test_an_empty_scene_can_be_drawn():
    image = scene_picture([], Paths({}, {}, np.zeros((0, 2))), ['nothing'])
    assert image.dtype == np.uint8 and image.ndim == 3


def test_images_are_arranged_in_rows_of_three():
    panels = [np.full((480, 640, 3), 10 * number, np.uint8) for number in range(1, 5)]
    image = scene_picture(panels, Paths({}, {}, np.zeros((0, 2))), [])
    assert [int(image[50, 100 + 488 * column, 0]) for column in range(3)] == [10, 20, 30]
    assert int(image[420, 100, 0]) == 40 and int(image[420, 600, 0]) == 255
