import numpy as np
import pytest
from hypothesis import given, strategies as st
from hypothesis.extra import numpy as hnp

from ros_3d_bb.camera.camera_model import OPTICAL_ROTATION, Camera, quaternion_from, transform_from, transform_points
from ros_3d_bb.camera.images import (mounted_camera, quarter_turns, turned_boxes, turned_camera, turned_image,
                                     turned_rotation, turns_for)

D435I = Camera(640, 480, 614.686, 614.842, 319.199, 242.08)


@given(hnp.arrays(float, (5, 2), elements=st.floats(-2000, 3000)), st.floats(0.1, 20))
def test_project_is_the_inverse_of_deproject(pixels, depth_m):
    points = D435I.deproject(pixels, np.full(5, depth_m))
    np.testing.assert_allclose(points[:, 2], depth_m)
    np.testing.assert_allclose(D435I.project(points), pixels, atol=1e-6)


@pytest.mark.parametrize('field,value', [('width', 0), ('height', -1), ('fx', 0), ('fy', float('nan')),
                                         ('fx', float('inf')), ('cx', float('nan'))])
def test_unusable_intrinsics_are_rejected(field, value):
    with pytest.raises(ValueError, match='camera'):
        Camera(**dict(D435I._asdict(), **{field: value}))


@given(st.tuples(*[st.floats(-1, 1)] * 4).filter(lambda q: np.linalg.norm(q) > 0.1))
def test_quaternion_from_is_the_inverse_of_transform_from(quaternion):
    found = quaternion_from(transform_from((1, 2, 3), quaternion))
    expected = np.array(quaternion) / np.linalg.norm(quaternion)
    assert found[3] >= 0
    np.testing.assert_allclose(found * np.sign(found.dot(expected)), expected, atol=1e-9)


def test_optical_frame_of_a_camera_that_points_ahead():
    """REP 103: in the body frame x is forward, y left, z up; the optical z is forward, x right, y down."""
    body_from_optical = transform_from((0.17, 0, 0.2), OPTICAL_ROTATION)
    np.testing.assert_allclose(transform_points(body_from_optical, [(1, 2, 3)]), [(3.17, -1, -1.8)], atol=1e-12)


@pytest.mark.parametrize('quaternion', [(0, 0, 0, 0), (float('nan'), 0, 0, 1), (float('inf'), 0, 0, 0)])
def test_quaternions_without_direction_are_rejected(quaternion):
    with pytest.raises(ValueError, match='quaternion'):
        transform_from((0, 0, 0), quaternion)


TURNS = range(4)


@pytest.mark.parametrize('turns', TURNS)
def test_boxes_enclose_the_same_pixels_of_the_turned_image(turns):
    image, boxes = np.arange(5 * 8).reshape(5, 8), np.array([(1, 0, 4, 3), (6, 2, 8, 5)])
    turned = turned_boxes(boxes, turns, 8, 5)
    for (x1, y1, x2, y2), (u1, v1, u2, v2) in zip(boxes, turned):
        np.testing.assert_array_equal(turned_image(image[y1:y2, x1:x2], turns),
                                      turned_image(image, turns)[v1:v2, u1:u2])
    back = turned_boxes(turned, -turns, *turned_image(image, turns).shape[::-1])
    np.testing.assert_array_equal(back, boxes)
    assert np.shares_memory(turned_image(image, turns), image)


@pytest.mark.parametrize('turns', TURNS)
@pytest.mark.parametrize('model, coefficients', [
    ('', ()), ('plumb_bob', (0.1, -0.2, 0.01, -0.004, 0.05)),
    ('inverse_brown_conrady', (0.1, -0.2, 0.01, -0.004, 0.05)),
    ('rational_polynomial', (0.1, -0.2, 0.01, -0.004, 0.05, 0.2, 0.1, 0.01)),
    ('equidistant', (0.1, 0.02, -0.01, 0.003))])
def test_points_are_projected_onto_the_same_pixels_of_the_turned_image(turns, model, coefficients):
    camera = Camera(640, 480, 600, 610, 310, 250, model, coefficients)
    points = np.array([(0.5, -0.3, 2.0), (-0.6, 0.4, 2.0)])
    u, v = camera.project(points).T
    pixel_boxes = np.stack((u - 0.5, v - 0.5, u + 0.5, v + 0.5), axis=1) + 0.5  # pixel u covers u..u + 1
    turned = turned_camera(camera, turns)
    expected = turned_boxes(pixel_boxes, turns, 640, 480)[:, :2]
    np.testing.assert_allclose(turned.project(points.dot(turned_rotation(turns).T)), expected, atol=1e-9)
    assert turned_camera(turned, -turns) == camera


@pytest.mark.parametrize('turns', TURNS)
@pytest.mark.parametrize('tilt_rad', [-0.5, 0.0, 0.9])
def test_turns_of_a_mounted_camera_and_a_positive_tilt_looks_down(turns, tilt_rad):
    pose = mounted_camera(1.2, tilt_rad, turns)
    up = pose[2, :3]
    assert quarter_turns(up) == turns_for('auto', up) == turns
    np.testing.assert_allclose(pose[:3, 2:].T, [(np.cos(tilt_rad), 0, -np.sin(tilt_rad)), (0, 0, 1.2)], atol=1e-12)
    np.testing.assert_allclose(turned_rotation(turns).dot(up), mounted_camera(1.2, tilt_rad, 0)[2, :3], atol=1e-12)


@pytest.mark.parametrize('image_rotation, turns', [('0', 0), ('90', 1), ('180', 2), ('270', 3), ('auto', 0)])
def test_a_given_rotation_is_used_and_an_unknown_one_is_none(image_rotation, turns):
    assert turns_for(image_rotation, None) == turns
