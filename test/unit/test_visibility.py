"""Why somebody is not seen. The camera stands at the origin of the map, 1 m up, and looks along x."""
import functools

import numpy as np
import pytest

from ros_3d_bb.estimation import DepthImage
from ros_3d_bb.geometry import OPTICAL_ROTATION, Camera, transform_from
from ros_3d_bb.tracking.tracked import OCCLUDED, OUT_OF_VIEW, VISIBLE, View
from ros_3d_bb.tracking.visibility import depths_towards, edges_of, places_in

CAMERA = Camera(640, 480, 600.0, 600.0, 319.5, 239.5)
LOOK = transform_from((0, 0, 1), OPTICAL_ROTATION)
PLAIN = View(LOOK, edges_of(CAMERA))


def place(x, y, view=PLAIN, others=(), farthest_m=6.0):
    """What the camera makes of the place (x, y), with others at places of their own."""
    positions_m = np.array([(x, y, 0.9)] + [tuple(other) + (0.9,) for other in others], float)
    return places_in(view, positions_m[:1], np.array([[0.5, 0.5, 1.7]]), positions_m, farthest_m)[0]


def with_depth(values_mm):
    depth = DepthImage(np.asarray(values_mm, np.uint16), 0.001)
    return PLAIN._replace(depth_at=functools.partial(depths_towards, CAMERA, depth))


def test_the_image_ends_where_the_camera_says():
    left, right = edges_of(CAMERA)
    assert left == pytest.approx(-320 / 600) and right == pytest.approx(320 / 600)


@pytest.mark.parametrize('x,y,expected', [
    (3, 0, VISIBLE), (3, 1.3, VISIBLE), (3, 1.7, OUT_OF_VIEW), (3, -1.7, OUT_OF_VIEW), (-3, 0, OUT_OF_VIEW),
    (0.2, 0, OUT_OF_VIEW), (7, 0, OUT_OF_VIEW)])
def test_places_are_in_view_or_not(x, y, expected):
    assert place(x, y) == expected


def test_a_camera_that_looks_to_the_left_sees_to_the_left():
    """An off-centre principal point: more is seen on one side."""
    camera = Camera(640, 480, 600.0, 600.0, 600.0, 239.5)
    view = View(LOOK, edges_of(camera))
    assert place(3, 2, view) == VISIBLE and place(3, -2, view) == OUT_OF_VIEW


def test_a_view_without_edges_sees_all_that_is_ahead():
    view = View(LOOK)
    assert place(3, 2.9, view) == VISIBLE and place(-1, 0, view) == OUT_OF_VIEW


@pytest.mark.parametrize('others,expected', [
    ([(2, 0)], OCCLUDED), ([(4, 0)], VISIBLE), ([(2, 0.8)], VISIBLE), ([(2.9, 0)], VISIBLE), ([], VISIBLE)])
def test_who_stands_behind_somebody_is_hidden(others, expected):
    assert place(3, 0, others=others) == expected


@pytest.mark.parametrize('depth_mm,expected', [(1500, OCCLUDED), (3000, VISIBLE), (4500, VISIBLE), (0, VISIBLE)])
def test_depth_that_ends_before_the_person_is_something_that_hides_them(depth_mm, expected):
    assert place(3, 0, with_depth(np.full((480, 640), depth_mm))) == expected


def test_a_pole_that_hides_an_arm_hides_nobody():
    depth_mm = np.full((480, 640), 5000)
    depth_mm[:, 345:375] = 1500
    assert place(3, 0, with_depth(depth_mm)) == VISIBLE


def test_depth_is_asked_for_where_points_are_and_nan_elsewhere():
    depth_mm = np.arange(480 * 640).reshape(480, 640) % 5000 + 1
    depth = DepthImage(depth_mm.astype(np.uint16), 0.001)
    points = CAMERA.deproject([[10, 20], [639, 479], [-5, 20], [10, 480]], 2.0)
    got = depths_towards(CAMERA, depth, np.vstack((points, [[0, 0, -1]])))
    np.testing.assert_allclose(got[:2], [depth_mm[20, 10] / 1000.0, depth_mm[479, 639] / 1000.0])
    assert np.isnan(got[2:]).all()
