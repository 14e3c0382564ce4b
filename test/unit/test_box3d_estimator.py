import doctest
from unittest import mock

import numpy as np
import pytest
from hypothesis import given, strategies as st

from ros_3d_bb.camera.camera_model import Camera
from ros_3d_bb.camera.images import DepthImage
from ros_3d_bb.core.object_classes import PERSON_CLASS
from ros_3d_bb.estimation import box3d_estimator, error_model
from ros_3d_bb.estimation.body import truncated_edges
from ros_3d_bb.estimation.box3d import HIDDEN, NO_DEPTH, NO_LAYER, NO_RAY, REPEATED, UNKNOWN, ImageGeometry, Rejected
from ros_3d_bb.estimation.box3d_estimator import estimate_boxes, estimator_named
from ros_3d_bb.estimation.depth_samples import nearest_dominant_layer
from ros_3d_bb.estimation.foreground import estimate_foreground
from ros_3d_bb.sessions.session_reader import read_depth, read_session

CAMERA = Camera(64, 48, 60.0, 60.0, 31.5, 23.5)
LAYER = 'ros_3d_bb.estimation.depth_samples.nearest_dominant_layer'


def of(camera):
    return ImageGeometry(camera, (0, 0) + camera[:2])


def flat(depth, scale_m=0.001, dtype=np.uint16):
    return DepthImage(np.full((48, 64), depth, dtype), scale_m)


def test_the_median_reproduces_the_recorded_positions(session_folder):
    """Within 1 mm an axis, plus the rounding of the record to whole millimetres."""
    session = read_session(session_folder)
    errors_m = []
    for frame in session.frames[::2]:
        depth, estimator = read_depth(frame, session), estimator_named('median')
        (box,) = estimator.estimate(depth, frame.boxes_px[:1], of(session.camera), [PERSON_CLASS])
        errors_m.append(np.abs(box.center_m - frame.estimate_m))
    assert len(errors_m) >= 40
    assert np.max(errors_m) <= 0.0015


@given(st.integers(-90, 80), st.integers(-90, 80), st.integers(1, 200), st.integers(1, 200), st.integers(1, 30))
def test_the_grid_is_centred_and_clipped_to_the_image(x1, y1, width, height, stride):
    samples = estimator_named('median', stride).sample(flat(1000), (x1, y1, x1 + width, y1 + height))
    expected = []
    columns, rows = -(-width // stride), -(-height // stride)
    for v in range(y1 + (height - (rows - 1) * stride - 1) // 2, y1 + height, stride):
        for u in range(x1 + (width - (columns - 1) * stride - 1) // 2, x1 + width, stride):
            if 0 <= u < 64 and 0 <= v < 48:
                expected.append((u, v))
    assert [tuple(pixel) for pixel in samples.pixels.reshape(-1, 2).tolist()] == expected


@pytest.mark.parametrize('depth,scale_m,dtype', [(0, 0.001, np.uint16), (np.nan, 1, np.float32),
                                                 (np.inf, 1, np.float32), (-1, 1, np.float32)])
def test_no_estimate_without_valid_depth(depth, scale_m, dtype):
    image = flat(depth, scale_m, dtype)
    for name in ('foreground', 'median'):
        assert not estimator_named(name).sample(image, (0, 0, 64, 48)).valid.any()
        outside = estimate_boxes(flat(2000), [(70, 10, 90, 20)], CAMERA, estimator_named(name))
        assert estimate_boxes(image, [(0, 0, 64, 48)], CAMERA, estimator_named(name)) == outside == [Rejected(NO_DEPTH)]


def foreground(depth, rect, *others, camera=CAMERA):
    rects = [rect] + list(others)
    return estimate_foreground(depth, rects, of(camera), [PERSON_CLASS] * len(rects))[0]


@pytest.mark.parametrize('behind_mm,painted,rect,person_m,support', [
    (0, [(np.s_[8:40, 28:36], 4000)], (26, 8, 38, 40), 4.0, 1),  # depth is missing around raised arms
    (0, [(np.s_[::5, ::5], 2000)], (4, 4, 60, 44), 2.0, 1),  # of a lidar
    (0, [(np.s_[10, 10], 3000)], (10, 10, 11, 11), 3.0, 1),
    (0, [(np.s_[10, 10:13], [3000, 3010, 3020])], (10, 10, 13, 11), 3.01, 1),
    # Flying pixels, the first one of which is in the layer of the person.
    (2000, [(np.s_[:, 31:34], [2200, 3000, 4000]), (np.s_[:, 34:], 4000)], (14, 4, 50, 44), 2.0, 0.5)])
def test_the_position_is_that_of_the_pixels_of_the_person(behind_mm, painted, rect, person_m, support):
    depth = flat(behind_mm)
    for area, depth_mm in painted:
        depth.values[area] = depth_mm
    box = foreground(depth, rect)
    assert box.center_m[2] == pytest.approx(person_m + PERSON_CLASS.axis) and box.support == pytest.approx(support)
    assert np.isfinite(box.center_m).all() and (box.size_m > 0).all()


@given(st.integers(500, 5000), st.floats(0.4, 1), st.integers(400, 3000))
def test_foreground_is_the_person_for_any_share_of_background(person_mm, share, behind_mm):
    """A plate before a wall that fills up to two thirds of the box: the median would be the wall."""
    depth = flat(person_mm + behind_mm)
    half = max(2, int(30 * share / 2))
    depth.values[:, 32 - half:32 + half] = person_mm
    box = foreground(depth, (17, 4, 47, 44))
    assert box.center_m[2] == pytest.approx(person_mm * 0.001 + PERSON_CLASS.axis, abs=1e-9)
    assert box.center_m[0] == pytest.approx(0, abs=0.5 / 60 * person_mm * 0.001)
    assert box.size_m[0] <= 1.1 * (2 * half) / 60 * person_mm * 0.001
    assert box.size_m[1] == pytest.approx(40 / 60 * person_mm * 0.001)


def test_foreground_masks_pixels_of_occluders():
    """A person half hidden by a nearer one, with boxes around the visible part of each."""
    depth = flat(5000)
    depth.values[10:40, 30:50] = 3000
    depth.values[5:45, 10:34] = 2000
    near, far = (10, 5, 34, 45), (28, 10, 50, 40)
    in_front = foreground(depth, near)
    assert in_front.center_m[2] == pytest.approx(2.0 + PERSON_CLASS.axis)
    assert foreground(depth, far, near).center_m[2] == pytest.approx(3.0 + PERSON_CLASS.axis)
    assert in_front.rect_px == near and foreground(depth, (12, 8, 30, 44), near) == Rejected(REPEATED)


def scattered(depth):
    """Depth everywhere, of no surface."""
    depth.values[...] = np.random.RandomState(0).randint(1000, 9000, depth.values.shape)


def at_the_edge(depth):
    depth.values[...], depth.values[:, 10:12] = 0, 2500


def too_little(depth):
    depth.values[...], depth.values[20:22, 30:33] = 0, 2500


def not_measured(depth):
    """A person in black clothes before a wall."""
    depth.values[6:44, 18:42] = 0


@pytest.mark.parametrize('change, reason', [(scattered, NO_LAYER), (at_the_edge, NO_LAYER), (too_little, NO_DEPTH),
                                            (not_measured, UNKNOWN)])
def test_the_reason_of_a_rejected_box_is_named(change, reason):
    depth = flat(5000)
    change(depth)
    assert foreground(depth, (10, 4, 50, 44)) == Rejected(reason)


def test_a_person_of_whom_only_head_and_feet_have_depth_is_there():
    depth = flat(5000)
    depth.values[5:44, 18:42] = 2500
    depth.values[14:38, 18:42] = 0
    assert foreground(depth, (14, 4, 46, 44)).center_m[2] == pytest.approx(2.5 + PERSON_CLASS.axis, abs=0.02)


@pytest.mark.parametrize('width_px,height_px,expected', [(24, 34, True), (40, 34, True), (46, 34, False),
                                                         (20, 46, True)])
def test_people_are_not_wider_than_their_arms_nor_higher_than_raised_arms(width_px, height_px, expected):
    """Of people at 3 m, a pixel is 0.05 m."""
    x, y = 32 - width_px // 2, 24 - height_px // 2
    depth = flat(6000)
    depth.values[y:y + height_px, x:x + width_px] = 3000
    assert foreground(depth, (x, y, x + width_px, y + height_px)).is_plausible == expected


def test_a_box_of_which_nearer_objects_show_everything_is_hidden():
    left, right = (5, 4, 34, 46), (30, 4, 60, 46)
    assert foreground(flat(2000), (20, 10, 44, 40), left, right) == Rejected(HIDDEN)


def test_occluders_of_occluders_mask_pixels():
    """Three people in a row, each covering half of the next: without the nearest one, the second would be wrong."""
    depth = flat(6000)
    depth.values[4:44, 30:54], depth.values[4:44, 18:42], depth.values[4:44, 6:30] = 4000, 3000, 2000
    rects = [(30, 4, 54, 42), (18, 4, 42, 43), (6, 4, 30, 44)]
    boxes = estimate_foreground(depth, rects, of(CAMERA), [PERSON_CLASS] * 3)
    np.testing.assert_allclose([box.center_m[2] - PERSON_CLASS.axis for box in boxes], [4, 3, 2], atol=1e-9)


def test_the_work_for_a_box_does_not_grow_with_the_number_of_boxes_that_overlap():
    """Of the same four people; the work is mainly that to determine layers."""
    camera, random = Camera(640, 480, 600.0, 600.0, 319.5, 239.5), np.random.RandomState(0)
    depth_mm = np.full((480, 640), 6000, np.uint16)
    for number in range(4):
        depth_mm[60:460, 80 + 130 * number:180 + 130 * number] = 1500 + 500 * number
    layers_each = {}
    for count in (20, 100):
        middle, half, top = (random.randint(*limits, count) for limits in ((80, 560), (15, 40), (60, 300)))
        rects_px = list(zip(middle - half, top, middle + half, [460] * count))
        with mock.patch(LAYER, wraps=nearest_dominant_layer) as determined:
            estimate_boxes(DepthImage(depth_mm, 0.001), rects_px, camera, estimator_named('foreground'))
        layers_each[count] = determined.call_count / count
    assert layers_each[100] <= 1.5 * layers_each[20], layers_each


def test_depths_beyond_any_camera_are_ignored():
    depth = flat(2.0, 1.0, np.float32)
    depth.values[10, 10], depth.values[20, 20] = 1e30, 1e7
    box = foreground(depth, (5, 5, 60, 45))
    assert box.center_m[2] == pytest.approx(2.0 + PERSON_CLASS.axis) and box.support == 1
    assert foreground(flat(1e-5, 1.0, np.float32), (5, 5, 60, 45)) == Rejected(NO_DEPTH)  # less than a millimetre


@pytest.mark.parametrize('module', [box3d_estimator, error_model])
def test_the_examples_give_what_they_state(module):
    results = doctest.testmod(module)
    assert results.attempted and not results.failed


@pytest.mark.parametrize('name,stride,complaint', [('mean', 20, "estimator is 'mean'"), ('median', 0, 'stride is 0')])
def test_unknown_estimators_and_strides_are_rejected(name, stride, complaint):
    with pytest.raises(ValueError, match=complaint):
        estimator_named(name, stride)


@pytest.mark.parametrize('rect,cut', [((10, 10, 210, 410), 't'), ((9, 13, 209, 413), ''), ((8, 13, 208, 413), 'l'),
                                      ((9, 20, 109, 400), ''), ((500, 20, 634, 400), 'r'), ((500, 20, 633, 400), ''),
                                      ((90, 200, 190, 471), 'b'), ((90, 200, 190, 470), ''),
                                      ((-9, 20, 650, 300), 'lr')])
def test_edges_at_the_border_are_truncated(rect, cut):
    assert truncated_edges(rect, (0, 0, 640, 480)) == tuple(edge in cut for edge in 'ltrb')


WIDE = Camera(640, 480, 420, 420, 319.5, 239.5, 'plumb_bob', (-0.25, 0.06, 0.0005, -0.0004, 0))
FISHEYE = Camera(640, 480, 306, 306, 319.5, 239.5, 'equidistant', (-0.0022, 0.0376, -0.0364, 0.0059))


def plate_in(camera, center_m, size_m):
    """Depth image of an upright plate in front of a wall at 6 m, and the rectangle around the plate."""
    v, u = np.mgrid[:camera.height, :camera.width]
    across, down = camera.rays(u, v)
    on_plate = ((np.abs(across * center_m[2] - center_m[0]) <= size_m[0] / 2)
                & (np.abs(down * center_m[2] - center_m[1]) <= size_m[1] / 2))
    sides = np.linspace(-0.5, 0.5, 200)
    outline = np.array([edge for side in sides for edge in ((side, -0.5), (side, 0.5), (-0.5, side), (0.5, side))])
    outline_px = camera.project(np.insert(outline * size_m + center_m[:2], 2, center_m[2], axis=1))
    rect_px = np.floor(outline_px.min(axis=0)).tolist() + np.ceil(outline_px.max(axis=0)).tolist()
    return DepthImage(np.where(on_plate, center_m[2], 6.0), 1.0), tuple(map(int, rect_px))


@pytest.mark.parametrize('camera', [WIDE, FISHEYE], ids=['plumb_bob', 'equidistant'])
@pytest.mark.parametrize('x_m', [-1.6, 0.0, 1.5])
def test_lens_distortion_is_corrected(camera, x_m):
    """Within 3 cm in position and 6 cm in height; without the correction, positions at the sides are wrong."""
    center_m = np.array([x_m, 0.3, 3.0])
    depth, rect = plate_in(camera, center_m, (0.5, 1.7))
    axis_m = center_m * (1 + PERSON_CLASS.axis / 3)
    box = foreground(depth, rect, camera=camera)
    np.testing.assert_allclose(box.center_m, axis_m, atol=0.03)
    assert box.size_m[1] == pytest.approx(1.7, abs=0.06) and box.size_m[0] == pytest.approx(0.5, abs=0.05)
    flat = foreground(depth, rect, camera=Camera(*camera[:6]))
    assert x_m == 0 or abs(flat.center_m[0] - axis_m[0]) > 0.08


@pytest.mark.parametrize('name', ['foreground', 'median'])
def test_no_estimate_at_right_angles_to_the_axis_of_a_fisheye(name):
    camera = Camera(640, 480, 150, 150, 319.5, 239.5, 'equidistant', (0, 0, 0, 0))
    estimator, rect = estimator_named(name), (10, 200, 60, 280)
    depth = DepthImage(np.full((480, 640), 2.0), 1.0)
    assert estimator.estimate(depth, [rect], of(camera), [PERSON_CLASS]) == [Rejected(NO_RAY)]
