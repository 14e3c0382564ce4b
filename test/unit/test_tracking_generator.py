"""Simulated runs of a robot among pedestrians: consistency of detections and ground truth."""
import numpy as np
import pytest

from ros_3d_bb.camera.camera_model import transform_points
from ros_3d_bb.tracking.types import VISIBLE
from ros_3d_bb_lab.evaluation.tracking.d435_model import CameraModel, half_width, shown
from ros_3d_bb_lab.evaluation.tracking.robot_motion import DRIVING, STANDING, OdometryModel
from ros_3d_bb_lab.evaluation.tracking.run_generator import Models, Timing, simulate
from ros_3d_bb_lab.evaluation.tracking.trajectories import made_sequences

SECONDS = 4
HALF_VIEW = CameraModel().field_of_view / 2
EXACT_CAMERA = CameraModel(matching_px=0, depth_floor_m=0, side_floor_m=0, slow_depth_m=0, slow_side_m=0, sway_m=0,
                           bias_left=0, outlier_share=0, miss_share=0, false_rate=0, double_share=0)
EXACT = Models(EXACT_CAMERA, OdometryModel(*[0.0] * 6), Timing(stamp_sigma_s=0, lost_share=0, stalls_hz=0))


@pytest.fixture(scope='module')
def dense():
    return made_sequences(0, 30)[1]


@pytest.fixture(scope='module', params=[STANDING, DRIVING])
def exact(request, dense):
    return simulate(dense, request.param, 0, EXACT, SECONDS)


def seen_from(view, points_m):
    """Points (n, 2) of the fixed frame as (right, forward) of the camera."""
    points_m = np.c_[points_m, np.zeros(len(points_m))]
    return transform_points(np.linalg.inv(view.fixed_from_camera), points_m)[:, [0, 2]]


def test_the_same_seed_gives_the_same_images_and_another_one_others(dense):
    first, again, other = (simulate(dense, DRIVING, seed, seconds=1) for seed in ((3, 0), (3, 0), (3, 1)))
    assert len(first.images) == len(again.images)
    for image, same in zip(first.images, again.images):
        assert image.stamp_ns == same.stamp_ns and image.sources == same.sources
        assert all(np.array_equal(a.position_m, b.position_m) for a, b in zip(image.detections, same.detections))
    assert first.images[0].stamp_ns != other.images[0].stamp_ns


def polar(image):
    """Bearings and ranges of the people in the truth of an image of a robot with exact odometry."""
    right_m, forward_m = seen_from(image.view, image.truth.position_m).T
    return np.arctan2(-right_m, forward_m), np.hypot(right_m, forward_m)


def shown_in(image):
    bearing, range_m = polar(image)
    return shown(bearing, half_width(range_m), range_m, HALF_VIEW)


def test_without_errors_whole_boxes_are_the_truth(exact):
    whole = truncated = 0
    for image in exact.images:
        share, _middle, _cut = shown_in(image)
        for detection, source in zip(image.detections, image.sources):
            row, = np.flatnonzero(image.truth.ids == source)
            if share[row] > 1 - 1e-9:
                whole += 1
                assert np.allclose(detection.position_m[:2], image.truth.position_m[row])
                assert not any(detection.truncated_edges)
            if any(detection.truncated_edges):
                truncated += 1
                of_body, of_box = (np.abs(np.arctan2(*seen_from(image.view, place_m)[0])) for place_m in (
                    image.truth.position_m[row:row + 1], detection.position_m[None, :2]))
                range_m = np.linalg.norm(image.truth.position_m[row] - image.view.fixed_from_camera[:2, 3])
                assert of_body + half_width(range_m) > HALF_VIEW > of_box and share[row] < 1
    assert whole > 100 and truncated > 5


def test_only_people_in_view_are_visible_or_detected(exact):
    for image in exact.images:
        bearing, range_m = polar(image)
        visible = image.truth.status == VISIBLE
        assert (np.abs(bearing[visible]) < HALF_VIEW).all() and (range_m[visible] < 6).all()
        assert (range_m[visible] * np.cos(bearing[visible]) > 0.3).all()
        found = np.isin(image.truth.ids, image.sources)
        assert (np.abs(bearing[found]) < HALF_VIEW + half_width(range_m[found])).all() and (range_m[found] < 6.2).all()
