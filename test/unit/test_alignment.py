"""Depth that is not aligned to colour is recognised by its edges, and aligned depth is not reported."""
import re

import pytest

from ros_3d_bb.camera.alignment import EdgeComparison
from ros_3d_bb.camera.camera_model import Camera
from ros_3d_bb.camera.depth_image import DepthImage
from ros_3d_bb.sessions.session_reader import read_color, read_depth, read_session
from ros_3d_bb_lab.simulation.scenario import scenario_from
from ros_3d_bb_lab.simulation.simulator import D435I_COLOR, Simulator

WALKING = [{'start': [3.0, -1.0], 'moves': [{'to': [3.5, 1.0]}]}]
APPROACHING = [{'start': [5.0, 0.8], 'moves': [{'to': [2.5, -0.5]}]}, {'start': [4.0, -1.0]}]
IMAGES = 8


def compared(images):
    """The fault of pairs of a colour image and a DepthImage."""
    comparison = EdgeComparison()
    for color, depth in images:
        comparison.add(color, depth)
    return comparison.fault()


def scene(people, seed=0, beside_m=0.0, camera=D435I_COLOR):
    """Colour images, and depth images of a camera to the left of the colour camera."""
    color, depth = (Simulator(scenario_from({'duration': 2.0, 'rate': IMAGES / 2.0, 'seed': seed, 'people': people,
                                             'robot': {'mount': [0.17, left_m, 0.2]}}), seen_by)
                    for left_m, seen_by in ((0.0, D435I_COLOR), (beside_m, camera)))
    for number in range(IMAGES):
        frame = color.frame(number)
        beside = depth.frame(number) if beside_m else frame
        yield frame.color, DepthImage(beside.depth_mm, 0.001)


def with_focal(focal_px):
    return Camera(640, 480, focal_px, focal_px, 318.0, 238.0)


@pytest.mark.slow
@pytest.mark.parametrize('people,beside_m,focal_px', [(WALKING, 0.05, 385.0), (APPROACHING, 0.075, 525.0),
                                                      (APPROACHING, -0.05, 575.0), (WALKING, 0.05, 614.0)])
def test_depth_from_beside_colour_is_recognised(people, beside_m, focal_px):
    fault = compared(scene(people, beside_m=beside_m, camera=with_focal(focal_px)))
    zoom, = re.findall('enlarged ([0-9.]+) times', fault)
    assert float(zoom) == pytest.approx(614.7 / focal_px, abs=0.06)


@pytest.mark.slow
@pytest.mark.parametrize('people,seed', [([], 0), (WALKING, 0), (APPROACHING, 1)])
def test_aligned_depth_is_not_reported(people, seed):
    assert not compared(scene(people, seed))


def test_recorded_images_are_not_reported(session_folder):
    session = read_session(session_folder)
    images = [(read_color(frame, session.camera), read_depth(frame, session)) for frame in session.frames[::3]]
    assert not compared(images[:IMAGES]) and not compared(images)


def test_images_in_which_nothing_moves_and_other_sizes_give_no_answer():
    color, depth = next(scene(WALKING, beside_m=0.05, camera=with_focal(385.0)))
    assert not compared([(color, depth)] * IMAGES)
    assert not compared([(color[::2], depth)])
