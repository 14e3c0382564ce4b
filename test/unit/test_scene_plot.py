"""Content of the image of a report."""
import cv2
import numpy as np
from matplotlib.colors import to_rgb

from ros_3d_bb_lab.evaluation.demo.scene_plot import ROBOT_COLOR, SIZE_IN, TRUTH_COLOR, draw_scene


def drawn(tmp_path, *content):
    path = str(tmp_path / 'scene.png')
    draw_scene(path, *content)
    return cv2.imread(path)[..., ::-1]


def rows_of(image, color):
    return np.nonzero((image == np.rint(255 * np.array(to_rgb(color)))).all(axis=-1))[0]


def test_the_top_view_shows_truth_tracks_and_robot(tmp_path):
    image = drawn(tmp_path, [], {1: [(2, 1), (4, 1)]}, {3: [(2, -1), (4, -1)]}, np.array([(0, 0), (1, 0)]), [])
    truth, robot, track = (rows_of(image, color) for color in (TRUTH_COLOR, ROBOT_COLOR, 'C0'))
    assert 0 < truth.mean() < robot.mean() < track.mean()  # y points up


def test_images_are_arranged_in_rows_of_three(tmp_path):
    panels = [np.full((480, 640, 3), 10 * number, np.uint8) for number in range(1, 5)]
    image = drawn(tmp_path, panels, {}, {}, np.zeros((0, 2)), ['a scene without people'])
    assert image.shape[1] == 100 * SIZE_IN[0]
    assert [int(image[100, 250 + 470 * column, 0]) for column in range(3)] == [10, 20, 30]
    assert 40 in image[:, 250, 0] and 40 not in image[:, 700, 0]
