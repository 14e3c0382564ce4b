"""Cameras and transforms: inverses and rejected values."""
import numpy as np
import pytest
from hypothesis import given, strategies as st
from hypothesis.extra import numpy as hnp

from ros_3d_bb.camera.camera_model import OPTICAL_ROTATION, Camera, quaternion_from, transform_from, transform_points

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
