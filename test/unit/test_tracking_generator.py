"""Simulated runs of a robot among pedestrians: consistency of detections and ground truth."""
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ros_3d_bb.camera.camera_model import transform_points
from ros_3d_bb.tracking.types import OCCLUDED, VISIBLE
from ros_3d_bb_lab.evaluation.tracking import robot_motion
from ros_3d_bb_lab.evaluation.tracking.d435_model import CameraModel, half_width, shown, thesis_bias_m
from ros_3d_bb_lab.evaluation.tracking.detection_generator import DetectablePerson, Detector
from ros_3d_bb_lab.evaluation.tracking.robot_motion import DRIVING, STANDING, OdometryModel
from ros_3d_bb_lab.evaluation.tracking.run_generator import HORIZONS_S, Models, Timing, simulate
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


def test_without_errors_whole_boxes_are_the_truth_and_truncated_ones_are_nearer_to_the_centre(exact):
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


def test_occluded_people_have_somebody_nearer_in_front_and_are_not_detected(exact):
    occluded = 0
    for image in exact.images:
        bearing, range_m = polar(image)
        for row in np.flatnonzero(image.truth.status == OCCLUDED):
            reach = half_width(range_m) + half_width(range_m[row])
            nearer = (range_m < range_m[row]) & (np.abs(bearing - bearing[row]) < reach)
            occluded += 1
            assert nearer.any() or np.abs(bearing[row]) + half_width(range_m[row]) > HALF_VIEW
            assert image.truth.ids[row] not in image.sources
    assert occluded > 5


def test_only_people_in_view_are_visible_or_detected(exact):
    for image in exact.images:
        bearing, range_m = polar(image)
        visible = image.truth.status == VISIBLE
        assert (np.abs(bearing[visible]) < HALF_VIEW).all() and (range_m[visible] < 6).all()
        assert (range_m[visible] * np.cos(bearing[visible]) > 0.3).all()
        found = np.isin(image.truth.ids, image.sources)
        assert (np.abs(bearing[found]) < HALF_VIEW + half_width(range_m[found])).all() and (range_m[found] < 6.2).all()


def test_velocities_and_futures_of_the_truth_are_those_of_the_walks(exact):
    for early, late in zip(exact.images, exact.images[1:]):
        known = dict(zip(late.truth.ids, late.truth.position_m))
        for person, place_m, velocity_mps in zip(early.truth.ids, early.truth.position_m, early.truth.velocity_mps):
            if person in known:
                assert np.allclose(known[person] - place_m, velocity_mps / 30, atol=0.005)
    later = int(30 * HORIZONS_S[-1])
    early, late = exact.images[0], exact.images[later]
    future = dict(zip(early.truth.ids, early.truth.future_m[:, -1]))
    both = [person for person in late.truth.ids if np.isfinite(future.get(person, np.nan)).all()]
    assert both
    for person in both:
        assert np.allclose(late.truth.position_m[late.truth.ids == person], future[person], atol=1e-6)


bearings = st.lists(st.tuples(st.floats(-1.2, 1.2), st.floats(0.5, 8)), min_size=1, max_size=8)


@given(bearings)
def test_shares_are_shares_the_nearest_is_whole_and_the_farther_hides_nobody(people):
    bearing, range_m = np.array(people).T
    range_m = range_m + 0.001 * np.arange(len(range_m))  # no ties
    half = half_width(range_m)
    share, middle, _cut = shown(bearing, half, range_m, HALF_VIEW)
    assert (share >= 0).all() and (share <= 1 + 1e-9).all()
    nearest, farthest = np.argmin(range_m), np.argmax(range_m)
    inside = min(bearing[nearest] + half[nearest], HALF_VIEW) - max(bearing[nearest] - half[nearest], -HALF_VIEW)
    assert share[nearest] == pytest.approx(max(0, inside) / (2 * half[nearest]), abs=1e-9)
    others = np.arange(len(people)) != farthest
    share_without, middle_without, _cut = shown(bearing[others], half[others], range_m[others], HALF_VIEW)
    assert np.array_equal(share_without, share[others]) and np.array_equal(middle_without, middle[others])


def test_odometry_drifts_from_the_truth_only_while_the_robot_drives():
    random = np.random.RandomState(0)
    standing = np.tile((1, 2, 0.5), (1001, 1))
    assert np.allclose(robot_motion.odometry_of(standing, OdometryModel(), random), standing)
    true = robot_motion.driving((1, 2), 0.5, 0.3, 30)
    moving = robot_motion.odometry_of(true, OdometryModel(), random)
    exact_path = robot_motion.odometry_of(true, OdometryModel(*[0.0] * 6), random)
    assert np.allclose(exact_path, true, atol=1e-6)
    off_m = np.linalg.norm(moving[:, :2] - true[:, :2], axis=1)
    assert off_m[0] == 0 and 0.02 < off_m.max() < 3
    assert np.linalg.norm(np.diff(true[:, :2], axis=0), axis=1).mean() == pytest.approx(0.007, rel=0.05)


@pytest.fixture(scope='module')
def boxes():
    """Detections in 20000 images of a person 3 m straight ahead."""
    detector, boxes = Detector(CameraModel(), 1, 1 / 30.0, np.random.RandomState(0)), []
    seen, pose = [DetectablePerson(0, 3.0, 3.0, 0.0, 1.0, False, 0.0, 0.0)], np.zeros(3)
    for number in range(20000):
        detector.advance(pose)
        boxes.append(detector.find(seen, pose, number / 30.0))
    return boxes


@pytest.mark.slow
def test_depth_errors_are_those_of_the_model_with_outliers_behind(boxes):
    camera = CameraModel()
    detected = [box for found in boxes for box in found if box.source == 0]
    errors_m = np.array([box.depth_m - 3 - 0.2 * thesis_bias_m(3) for box in detected])
    usual_m = errors_m[errors_m < 0.15]
    assert np.mean(errors_m > 0.2) == pytest.approx(0.05, abs=0.015) and errors_m.min() > -0.25
    assert usual_m.std() == pytest.approx(np.sqrt(camera.covariance_m2(0.0, 3.0)[2, 2]), rel=0.08)
    assert abs(usual_m.mean()) < 0.01
    sides_m = np.array([3 * box.bearing for box in detected])
    assert sides_m.std() == pytest.approx(np.sqrt(camera.covariance_m2(0.0, 3.0)[0, 0]), rel=0.1)
    near_m = np.array([box.depth_m for box in detected if box.depth_m < 3.1])
    assert 0.4 < np.corrcoef(near_m[:-1], near_m[1:])[0, 1] < 0.8  # half a second for one part, none for the other


def test_the_thesis_bias_goes_on_smoothly_beyond_what_was_measured():
    assert thesis_bias_m([1.0, 3.0]) == pytest.approx([0.028, -0.172])
    assert thesis_bias_m(6.0) == pytest.approx(2 * thesis_bias_m(3.0))
