import cv2
import numpy as np
import pytest
from hypothesis import given, strategies as st
from hypothesis.extra import numpy as hnp

from ros_3d_bb.camera.camera_model import Camera, quaternion_from, transform_from
from ros_3d_bb.camera.distortion import EQUIDISTANT, INVERSE_BROWN_CONRADY, PLUMB_BOB, RATIONAL_POLYNOMIAL
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


# Horizontal field of view in degrees, where the camera has 640 x 480, and the lens. The first is a D435's colour
# camera, the second a D455's, then a wide-angle lens, an Azure Kinect's, and T265's fisheye cut to 120 degrees.
LENSES = [(55, PLUMB_BOB, (0.16, -0.5, -0.001, 0.0006, 0.47)),
          (79, PLUMB_BOB, (-0.055, 0.065, -0.0003, 0.0009, -0.021)),
          (94, RATIONAL_POLYNOMIAL, (8.5, 5.2, 1e-4, -5e-5, 0.21, 8.9, 8.0, 1.35)),
          (56, RATIONAL_POLYNOMIAL, (0.52, -2.73, 7.4e-4, -8e-5, 1.57, 0.40, -2.55, 1.50)),
          (55, INVERSE_BROWN_CONRADY, (0.16, -0.5, -0.001, 0.0006, 0.47)),
          (120, EQUIDISTANT, (-0.0022, 0.0376, -0.0364, 0.0059)), (120, EQUIDISTANT, (0, 0, 0, 0))]
SIZES = [(640, 480), (1280, 720)]


def camera_of(lens, size):
    fov_deg, model, coefficients = lens
    half = np.radians(fov_deg / 2)
    focal = size[0] / 2 / (half if model == EQUIDISTANT else np.tan(half))
    return Camera(size[0], size[1], focal, 1.001 * focal, size[0] / 2 - 0.8, size[1] / 2 + 2.1, model, coefficients)


CAMERAS = [camera_of(lens, size) for size in SIZES for lens in LENSES]
FOR_OPENCV = [camera for camera in CAMERAS if camera.distortion_model != INVERSE_BROWN_CONRADY]


def named(camera):
    return '%s-%d' % (camera.distortion_model, camera.width)


def every_pixel(camera, step):
    """(n, 2), including the corners."""
    u, v = np.meshgrid(*(np.unique(np.append(np.arange(0, size, step), size - 1)) for size in camera[:2]))
    return np.stack((u, v), axis=-1).reshape(-1, 2).astype(float)


@pytest.mark.slow
@pytest.mark.parametrize('camera', FOR_OPENCV, ids=named)
def test_equals_opencv(camera):
    """Rays to 1e-6 pixels where OpenCV iterates until convergence, and pixels by its own projection."""
    pixels = every_pixel(camera, 7)
    matrix = np.array([[camera.fx, 0, camera.cx], [0, camera.fy, camera.cy], [0, 0, 1]])
    points, lens = camera.deproject(pixels, 1.0), np.array(camera.distortion)
    assert np.abs(camera.project(points) - pixels).max() < 1e-6
    if camera.distortion_model == EQUIDISTANT:
        rays = cv2.fisheye.undistortPoints(pixels[:, None], matrix, lens)
        back = cv2.fisheye.distortPoints(points[:, None, :2], matrix, lens)
    else:
        until = (cv2.TERM_CRITERIA_COUNT + cv2.TERM_CRITERIA_EPS, 200, 1e-14)
        rays = cv2.undistortPointsIter(pixels[:, None], matrix, lens, None, None, until)
        back, _jacobian = cv2.projectPoints(points[:, None], np.zeros(3), np.zeros(3), matrix, lens)
    assert np.abs((rays[:, 0] - points[:, :2]) * camera[2:4]).max() < 1e-6
    assert np.abs(back[:, 0] - pixels).max() < 1e-6


@pytest.mark.parametrize('camera', CAMERAS, ids=named)
def test_opencv_before_3_3_1_gives_the_same_rays(camera, monkeypatch):
    """Ubuntu 18.04 has OpenCV 3.2; undistortPointsIter came with 3.3.1."""
    pixels = every_pixel(camera, 29)
    expected = camera.undistort(pixels)
    monkeypatch.delattr(cv2, 'undistortPointsIter')
    np.testing.assert_allclose(camera.undistort(pixels), expected, rtol=1e-9, atol=1e-6)


@pytest.mark.parametrize('camera', CAMERAS[:len(LENSES)], ids=named)
@pytest.mark.parametrize('offset_px', [0, 1e-9, 1e-6, 3e-6, 1e-5, 1e-4])
def test_pixels_next_to_the_axis_have_a_ray(camera, offset_px):
    pixel = np.array((camera.cx + offset_px, camera.cy - offset_px))
    np.testing.assert_allclose(camera.project(camera.deproject(pixel, 1.0)), pixel, rtol=0, atol=1e-9)
    assert camera.deproject(np.zeros((0, 2)), np.zeros(0)).shape == camera.project(np.zeros((0, 3))).shape[:1] + (3,)


def test_there_are_no_rays_and_images_beyond_a_fold_of_the_polynomial():
    """r - 0.4 r^3 grows up to r = 0.913, where it is 0.609."""
    camera = Camera(640, 480, 500, 500, 320, 240, PLUMB_BOB, (-0.4, 0, 0, 0, 0))
    pixels = np.array([(320 + 500 * 0.6, 240), (320 + 500 * 0.62, 240)])
    points = camera.deproject(pixels, 2.0)
    assert 1.6 < points[0, 0] < 2 * 0.913 and np.isnan(points[1, :2]).all() and points[1, 2] == 2.0
    assert np.isfinite(camera.project((0.9, 0, 1))).all() and np.isnan(camera.project((0.93, 0, 1))).all()


@pytest.mark.parametrize('model,given,kept', [
    ('', (), ()), ('none', (0,) * 5, ()), (RATIONAL_POLYNOMIAL, (0,) * 5, ()), (EQUIDISTANT, (0,) * 5, (0,) * 4),
    (PLUMB_BOB, (0.1, 0, 0, 0), (0.1, 0, 0, 0, 0)), (PLUMB_BOB, (0.1, 0, 0, 0, 0.2, 0), (0.1, 0, 0, 0, 0.2))])
def test_missing_and_appended_zeros_are_normalised(model, given, kept):
    camera = Camera(640, 480, 600, 600, 320, 240, model, given)
    assert camera.distortion == kept and camera.distortion_model == (model if kept else '')


@pytest.mark.parametrize('model,coefficients,reason', [
    ('thin_prism', (0.1,) * 5, "'thin_prism'; one of equidistant, inverse_brown_conrady, plumb_bob, rational"),
    (PLUMB_BOB, (0.1,) * 3, r'plumb_bob has 3 .*; 5 expected \(k1, k2, p1, p2, k3\)'),
    (EQUIDISTANT, (0.1,) * 5, '4 expected'), (INVERSE_BROWN_CONRADY, (0.1,) * 4, '5 expected'),
    (PLUMB_BOB, (float('nan'), 0, 0, 0, 0), 'finite'), (PLUMB_BOB, (1e9, 0, 0, 0, 0), 'below 1e')])
def test_unusable_distortion_is_rejected(model, coefficients, reason):
    with pytest.raises(ValueError, match=reason):
        Camera(640, 480, 600, 600, 320, 240, model, coefficients)
