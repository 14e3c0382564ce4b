import re

import numpy as np
import pytest

from ros_3d_bb.camera.alignment import EdgeComparison
from ros_3d_bb.camera.camera_model import Camera, transform_from
from ros_3d_bb.camera.images import DepthImage
from ros_3d_bb.camera.registration import RegisteredDepth, Registration
from ros_3d_bb.sessions.session_reader import read_color, read_depth, read_session
from ros_3d_bb_lab.simulation.scenario import scenario_from
from ros_3d_bb_lab.simulation.simulator import D435I_COLOR, Simulator

COLOR, DEPTH_CAMERA = Camera(640, 480, 614.686, 614.842, 319.199, 242.08), Camera(848, 480, 421.0, 421.0, 424.2, 238.9)
WIDE = Camera(160, 120, 80.0, 80.0, 79.5, 59.5)
NEAR_M, WALL_M = 2.0, 4.0
STRIPE = slice(60, 80)  # columns of a wide image that show something near


def stripe():
    """Depth of a wide camera, metres: something near in front of a wall."""
    depth_m = np.full((WIDE.height, WIDE.width), WALL_M, np.float32)
    depth_m[:, STRIPE] = NEAR_M
    return depth_m


def registered(depth_m, color, shift_m, depth_camera=WIDE, rotation=(0, 0, 0, 1)):
    return RegisteredDepth(DepthImage(depth_m, 1.0), Registration(color, depth_camera,
                                                                  transform_from((shift_m, 0, 0), rotation)))


@pytest.mark.parametrize('zoom', [0.5, 1.0, 1.7, 3.0])
def test_registered_points_leave_no_gaps_and_hide_what_is_behind(zoom):
    """The stripe moves by its disparity; beside it, the depth camera sees no wall."""
    color = Camera(int(160 * zoom), int(120 * zoom), 80 * zoom, 80 * zoom, 79.5 * zoom, 59.5 * zoom)
    depth_m = registered(stripe(), color, 0.2).values
    left, right = ((edge - 0.5 - 79.5) * zoom + 80 * zoom * 0.2 / NEAR_M + 79.5 * zoom for edge in (60, 80))
    row = depth_m[depth_m.shape[0] // 2]
    near = np.flatnonzero(row == NEAR_M)
    assert near[0] == pytest.approx(left, abs=1 + zoom) and near[-1] == pytest.approx(right, abs=1 + zoom)
    assert len(near) == near[-1] - near[0] + 1
    unseen = np.flatnonzero(row == 0)
    unseen = unseen[unseen > 0.2 * len(row)]  # but for the border
    assert len(unseen) == pytest.approx(80 * zoom * 0.2 * (1 / NEAR_M - 1 / WALL_M), abs=1 + zoom)
    assert (np.abs(unseen - near[0]) < 10 * zoom).all()


@pytest.mark.parametrize('value', [0, np.nan, np.inf, -1, 1e4])
def test_invalid_depth_is_not_registered(value):
    assert not registered(np.full((120, 160), value, np.float32), COLOR, 0.05).values.any()


def test_a_rotated_distorted_depth_camera_sees_the_same_points():
    """A wall at an angle: each registered depth lies on it."""
    fisheye = Camera(160, 120, 80.0, 80.0, 79.5, 59.5, 'plumb_bob', (-0.1, 0.01, 0.001, 0.0, 0.0))
    pinhole = Camera(320, 240, 300.0, 300.0, 159.5, 119.5, 'plumb_bob', (0.05, 0.0, 0.0, 0.001, 0.0))
    color_from_depth = transform_from((0.03, 0.01, -0.02), (0.05, 0.0, 0.02, 1))
    normal, offset_m = np.array([0.3, 0.2, 1.0]), 3.0  # of the wall, in the colour frame
    rays = fisheye.deproject(np.stack(np.meshgrid(np.arange(160), np.arange(120)), axis=-1), 1.0)
    there = normal.dot(color_from_depth[:3, :3])
    depth_m = (offset_m - normal.dot(color_from_depth[:3, 3])) / rays.dot(there)
    part = RegisteredDepth(DepthImage(depth_m, 1.0), Registration(pinhole, fisheye, color_from_depth)).part(
        slice(20, 220, 8), slice(20, 300, 8))
    pixels = np.stack(np.meshgrid(np.arange(20, 300, 8), np.arange(20, 220, 8)), axis=-1)
    expected_m = offset_m / pinhole.deproject(pixels, 1.0).dot(normal)
    assert (part > 0).mean() > 0.95
    assert np.abs(part - expected_m)[part > 0].max() < 0.02  # the slope of the wall within a pixel


WALKING = [{'start': [3.0, -1.0], 'moves': [{'to': [3.5, 1.0]}]}]
APPROACHING = [{'start': [5.0, 0.8], 'moves': [{'to': [2.5, -0.5]}]}, {'start': [4.0, -1.0]}]
IMAGES = 8


def compared(images):
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
@pytest.mark.parametrize('people,beside_m,focal_px', [(WALKING, 0.05, 385.0), (APPROACHING, -0.05, 575.0)])
def test_depth_from_beside_colour_is_recognised(people, beside_m, focal_px):
    fault = compared(scene(people, beside_m=beside_m, camera=with_focal(focal_px)))
    zoom, = re.findall('enlarged ([0-9.]+) times', fault)
    assert float(zoom) == pytest.approx(614.7 / focal_px, abs=0.06)


@pytest.mark.slow
@pytest.mark.parametrize('people,seed', [([], 0), (APPROACHING, 1)])
def test_aligned_depth_is_not_reported(people, seed):
    assert not compared(scene(people, seed))


def test_recorded_images_are_not_reported(session_folder):
    session = read_session(session_folder)
    images = [(read_color(frame, session.camera), read_depth(frame, session)) for frame in session.frames[::3]]
    assert not compared(images[:IMAGES]) and not compared(images)
