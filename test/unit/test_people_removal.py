"""Which points and pixels show tracked people."""
import numpy as np
import pytest

from ros_3d_bb.camera.camera_model import OPTICAL_ROTATION, Camera, transform_from, transform_points
from ros_3d_bb.camera.depth_image import DepthImage
from ros_3d_bb.planning.people_removal import are_inside, cylinders_of, pixels_inside
from support.tracks import track_at

CAMERA = Camera(64, 48, 60.0, 60.0, 31.5, 23.5)
MARGIN_M = 0.2


def test_cylinders_are_where_people_are_then_and_wider_if_uncertain():
    walking = track_at([2, 1, 0.85], [1.0, 0, 0], covariance=np.diag([0.01, 0.04, 0, 0, 0, 0]))
    walking = walking._replace(prediction_covariance_m2=np.tile(walking.covariance[:3, :3], (8, 1, 1)))
    dog = track_at([0, 0, 0.3], [0, 0, 0])._replace(label='dog')
    (x, y, radius_m, low_m, high_m), = cylinders_of([walking, dog], 0.3, MARGIN_M)
    assert (x, y, radius_m) == pytest.approx((2.3, 1.0, 0.25 + MARGIN_M + 0.2))
    assert (low_m, high_m) == pytest.approx((-MARGIN_M, 1.7 + MARGIN_M))
    assert cylinders_of([], 0.3, MARGIN_M).shape == (0, 5)


@pytest.mark.parametrize('place_m', [(2.0, 0.3), (0.4, 0.1), (3.0, 2.5), (-2.0, 0.0)])
def test_pixels_are_those_whose_points_lie_in_the_cylinder(place_m):
    """Compared with all pixels one by one; the search is restricted to a part of the image."""
    depth = DepthImage(np.random.RandomState(1).choice([0, 400, 1900, 2100, 3000], (48, 64)).astype(np.uint16), 0.001)
    fixed_from_camera = transform_from((0, 0, 1), OPTICAL_ROTATION)
    cylinders = cylinders_of([track_at(place_m + (0.85,), [0, 0, 0])], 0.0, MARGIN_M)
    v, u = np.mgrid[:48, :64]
    points_m = CAMERA.deproject(np.stack((u, v), axis=-1), depth.values * depth.scale_m)
    expected = are_inside(transform_points(fixed_from_camera, points_m), cylinders) & (depth.values > 0)
    assert (pixels_inside(depth, CAMERA, fixed_from_camera, cylinders) == expected).all()
    assert expected.any() == (place_m in ((2.0, 0.3), (0.4, 0.1)))
