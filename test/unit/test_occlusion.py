"""Visibility of people. The camera stands at the origin of the map, 1 m up, and points along x."""
import functools

import numpy as np
import pytest
from hypothesis import assume, given, settings, strategies as st

from ros_3d_bb.camera.camera_model import Camera
from ros_3d_bb.camera.images import DepthImage
from ros_3d_bb.tracking.occlusion import classify_visibility, depths_towards
from ros_3d_bb.tracking.track import PRESENT, STAYED
from ros_3d_bb.tracking.types import OCCLUDED, OUT_OF_VIEW, VISIBLE, CameraView
from support.people import mounted

CAMERA = Camera(640, 480, 600.0, 600.0, 319.5, 239.5)
LOOK = mounted(1.0)
PLAIN = CameraView(LOOK, CAMERA)


def place(x, y, view=PLAIN, others=(), farthest_m=6.0):
    """Visibility of a person at (x, y), with other people."""
    positions_m = np.array([(x, y, 0.9)] + [tuple(other) + (0.9,) for other in others], float)
    return classify_visibility(view, positions_m[:1], np.array([[0.5, 0.5, 1.7]]), positions_m, farthest_m)[0]


def with_depth(values_mm):
    depth = DepthImage(np.asarray(values_mm, np.uint16), 0.001)
    return PLAIN._replace(depth_at=functools.partial(depths_towards, CAMERA, depth))


FOLDING = Camera(640, 480, 280, 280, 320, 240, 'plumb_bob', (-0.35, 0.12, 0, 0, -0.019))  # before the border


@pytest.mark.parametrize('x,y,expected', [
    (3, 0, VISIBLE), (3, 2.5, VISIBLE), (-3, 0, OUT_OF_VIEW), (0.5, 3, OUT_OF_VIEW)])
def test_the_field_of_view_ends_where_the_distortion_folds(x, y, expected):
    assert place(x, y, CameraView(LOOK, FOLDING)) == expected


def pixels_on_axis(camera, fixed_from_camera, x, y):
    """Share of the axis of a 1.7 m tall person at (x, y) in the image, by homogeneous coordinates: the oracle."""
    axis = np.array([(x, y, z, 1) for z in np.linspace(0.02, 1.68, 200)])
    right, down, forward, _one = np.linalg.inv(fixed_from_camera).dot(axis.T)
    with np.errstate(all='ignore'):
        u, v = camera.fx * right / forward + camera.cx, camera.fy * down / forward + camera.cy
    return ((forward > 0) & (abs(u + 0.5 - camera.width / 2) < camera.width / 2)
            & (abs(v + 0.5 - camera.height / 2) < camera.height / 2)).mean()


@settings(max_examples=300, deadline=None)
@given(height=st.floats(0.1, 3.0), pitch=st.floats(-60, 90), roll=st.floats(-180, 180), focal=st.floats(200, 1000),
       x=st.floats(-6, 6), y=st.floats(-6, 6))
def test_what_is_visible_is_in_the_image_and_what_is_out_of_view_is_not(height, pitch, roll, focal, x, y):
    """However the camera is mounted; between 10 % and 60 % of the body, and near the borders, either is right."""
    camera, transform = Camera(640, 480, focal, focal, 319.5, 239.5), mounted(height, pitch, roll)
    assume(np.hypot(x, y) > 0.5)
    shown, narrower = (pixels_on_axis(camera._replace(fx=f, fy=f), transform, x, y) for f in (focal, 1.4 * focal))
    result = place(x, y, CameraView(transform, camera), farthest_m=20.0)
    assert result != VISIBLE or shown > 0.1
    assert result != OUT_OF_VIEW or narrower < 0.6


def test_no_occlusion_between_opposite_sides_of_a_downward_camera():
    view = CameraView(mounted(3, 90), CAMERA)
    assert place(0.02, 0.9, view, others=[(-0.02, 0.4)]) == OCCLUDED
    assert place(0.02, 0.9, view, others=[(-0.02, -0.4)]) == VISIBLE


@pytest.mark.parametrize('others,expected', [
    ([(2, 0)], OCCLUDED), ([(4, 0)], VISIBLE), ([(2, 0.8)], VISIBLE), ([(2.9, 0)], VISIBLE), ([], VISIBLE)])
def test_a_person_behind_another_one_is_occluded(others, expected):
    assert place(3, 0, others=others) == expected


@pytest.mark.parametrize('x,depth_mm,expected', [
    (3, 1500, OCCLUDED), (3, 2950, VISIBLE), (3, 3000, VISIBLE), (3, 4500, VISIBLE), (3, 0, VISIBLE),
    (0.9, 850, PRESENT), (0.6, 550, PRESENT), (0.9, 4000, VISIBLE), (0.9, 0, OUT_OF_VIEW)])
def test_depth_tells_who_is_occluded_and_who_is_too_near_to_be_detected(x, depth_mm, expected):
    assert place(x, 0, with_depth(np.full((480, 640), depth_mm))) == expected


@pytest.mark.parametrize('aside', [-0.1, 0.0, 0.1])
def test_legs_apart_are_a_person_whose_head_is_above_the_image(aside):
    depth_mm = np.full((480, 640), 4000)
    depth_mm[:, 230:300] = depth_mm[:, 350:420] = 850
    assert place(0.9, aside, with_depth(depth_mm)) in (PRESENT, STAYED)


def test_a_pole_before_an_arm_does_not_occlude_the_person():
    depth_mm = np.full((480, 640), 5000)
    depth_mm[:, 345:375] = 1500
    assert place(3, 0, with_depth(depth_mm)) == VISIBLE


@pytest.mark.parametrize('roll_deg,half', [(0, 0.6), (90, 0.45)])
def test_the_outline_of_a_view_has_its_horizontal_edges_as_sides(roll_deg, half):
    """A camera at (1, 2) that looks along y and down, upright and in portrait."""
    pose = mounted(1.0, pitch_deg=20, yaw_deg=90, roll_deg=roll_deg)
    pose[:2, 3] = 1, 2
    camera = Camera(640, 480, 533.3, 533.3, 320, 240)
    place_m, left_m, right_m = CameraView(pose, camera).outline(4.0)
    side = np.arctan(half / np.cos(np.radians(20)))
    np.testing.assert_allclose(place_m, (1, 2))
    np.testing.assert_allclose(left_m - place_m, (-4 * np.sin(side), 4 * np.cos(side)), atol=0.01)
    np.testing.assert_allclose(right_m - place_m, (4 * np.sin(side), 4 * np.cos(side)), atol=0.01)
