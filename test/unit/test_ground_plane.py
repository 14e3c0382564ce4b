import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from ros_3d_bb.camera.camera_model import Camera
from ros_3d_bb.camera.images import DepthImage
from ros_3d_bb.detection.depth.ground_plane import MAX_HIGHER, FittedFloor, Floor, KnownFloor, fit_floor
from ros_3d_bb.detection.depth.person_clusters import DepthPeopleParams

CAMERA = Camera(320, 240, 300.0, 300.0, 159.5, 119.5)
V, U = np.mgrid[:CAMERA.height, :CAMERA.width]
RAYS = CAMERA.deproject(np.stack((U, V), axis=-1), np.ones(U.shape))


def floor_of(pitch, roll, height_m):
    """Floor of a camera that is pitched down by `pitch` and rolled by `roll`, in radians."""
    return Floor(np.array([np.sin(roll), -np.cos(roll) * np.cos(pitch), -np.cos(roll) * np.sin(pitch)]), height_m)


def depth_of(floor, wall_m=5.0, noise=0.0):
    """Depth image of a plane and a wall behind it, with noise of `noise` * depth**2."""
    slope = RAYS.dot(floor.normal)
    plane_m = np.where(slope < -1e-6, -floor.offset_m / np.minimum(slope, -1e-6), np.inf)
    depth_m = np.minimum(plane_m, wall_m)
    return depth_m + noise * depth_m ** 2 * np.random.RandomState(1).randn(*depth_m.shape)


@settings(max_examples=60)
@given(st.floats(-0.1, 1.05), st.floats(-0.3, 0.3), st.floats(0.1, 3.0), st.booleans())
def test_the_floor_is_fitted_at_any_height_and_tilt(pitch, roll, height_m, in_millimetres):
    truth = floor_of(pitch, roll, height_m)
    if np.mean(depth_of(truth) < 4.9) < 0.15:
        return  # hardly any floor in view
    depth_m = depth_of(truth, noise=0.002)
    depth = DepthImage((depth_m * 1000).astype(np.uint16), 0.001) if in_millimetres else DepthImage(depth_m, 1.0)
    floor = fit_floor(depth, CAMERA)
    np.testing.assert_array_equal(fit_floor(depth, CAMERA).normal, floor.normal)
    assert abs(floor.offset_m - height_m) < 0.01 + 0.02 * height_m
    assert np.degrees(np.arccos(min(1, floor.normal.dot(truth.normal)))) < 1


def image_of(floor, *tables):
    """Depth image of a floor, with parts of higher planes: (height of the camera above it, columns, farthest depth)."""
    depth_m = depth_of(floor)
    for height_m, columns, farthest_m in tables:
        table_m = depth_of(floor._replace(offset_m=height_m))
        on_table = (table_m < farthest_m) & (U < columns)
        depth_m[on_table] = table_m[on_table]
    return DepthImage(depth_m, 1.0)


@pytest.mark.parametrize('pitch,height_m,tables', [
    (0.3, 1.2, [(0.5, 220, 2.0)]),  # covers more of the image than the floor
    (0.3, 1.2, [(0.5, 260, 2.5)]), (0.9, 1.8, [(1.1, 270, 9.0)]), (0.5, 2.8, [(2.0, 200, 4.0)])])
def test_a_table_is_not_the_floor(pitch, height_m, tables):
    truth = floor_of(pitch, 0, height_m)
    floor = fit_floor(image_of(truth, *tables), CAMERA)
    assert abs(floor.offset_m - height_m) < 0.02 and floor.normal.dot(truth.normal) > np.cos(np.radians(1))


def test_a_table_does_not_replace_the_floor_of_earlier_images():
    """Unless it is the only plane for so long that the camera must have been lowered."""
    floor, table = image_of(floor_of(0.4, 0, 1.2)), image_of(floor_of(0.4, 0, 0.5))
    fitted, params = FittedFloor(), DepthPeopleParams()
    heights_m = [fitted.update(image, CAMERA, params).offset_m
                 for image in [table, floor] + MAX_HIGHER * [table] + [floor] + (MAX_HIGHER + 1) * [table] + [floor]]
    expected_m = [0.5] + (1 + MAX_HIGHER + 1 + MAX_HIGHER) * [1.2] + [0.5, 1.2]
    np.testing.assert_allclose(heights_m, expected_m, atol=0.02)


@pytest.mark.parametrize('known, shown, expected', [
    (floor_of(0.02, 0, 1.07), floor_of(0.05, 0.02, 1.07), 'shown'),  # the robot brakes
    (floor_of(0.3, 0, 1.9), floor_of(0.3, 0, 2.0), 'shown'),  # floor_height is wrong
    (floor_of(0.4, 0, 1.2), floor_of(0.4, 0, 0.5), 'known'),  # a table hides the floor
    (floor_of(0.3, 0, 1.2), floor_of(0.3, 0, 1.2), 'known')])
def test_the_floor_with_more_points_on_it_wins_unless_it_is_a_table(known, shown, expected):
    floor = KnownFloor()
    corrected = floor.correct(known, DepthImage(depth_of(shown, noise=0.0034), 1.0), CAMERA, DepthPeopleParams())
    if expected == 'known':
        assert corrected is known
    else:
        np.testing.assert_allclose(corrected.normal, shown.normal, atol=0.01)
        assert abs(corrected.offset_m - shown.offset_m) < 0.02
    assert floor.of(known).offset_m == corrected.offset_m


def test_the_result_is_none_without_a_floor():
    for depth_m in (np.zeros(U.shape), np.full(U.shape, np.nan), np.full(U.shape, 2.0), 1 + U / 300.0,
                    depth_of(floor_of(0.2, 0, 3.5))):
        assert fit_floor(DepthImage(depth_m, 1.0), CAMERA) is None
