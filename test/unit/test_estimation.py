"""The thesis' estimator: its recorded positions, its grid, and what it does with what it cannot use."""
import numpy as np
import pytest
from hypothesis import given, strategies as st

from ros_3d_bb.estimation import DepthImage, estimate_median, is_truncated, sample_median
from ros_3d_bb.geometry import Camera
from ros_3d_bb.measurements import read_depth, read_session

CAMERA = Camera(64, 48, 60.0, 60.0, 31.5, 23.5)


def flat(depth, scale_m=0.001, dtype=np.uint16):
    return DepthImage(np.full((48, 64), depth, dtype), scale_m)


def test_reproduces_the_recorded_positions(session_folder):
    """Within 1 mm an axis, plus the rounding of the record to whole millimetres."""
    session = read_session(session_folder)
    errors_m = []
    for frame in session.frames:
        samples = sample_median(read_depth(frame, session), frame.boxes_px[0])
        box = estimate_median(samples, frame.boxes_px[0], session.camera)
        errors_m.append(np.abs(box.center_m - frame.estimate_m))
    assert len(errors_m) >= 80
    assert np.max(errors_m) <= 0.0015


@given(st.integers(-90, 80), st.integers(-90, 80), st.integers(1, 200), st.integers(1, 200), st.integers(1, 30))
def test_grid_is_the_centred_one_cut_at_the_border(x1, y1, width, height, stride):
    samples = sample_median(flat(1000), (x1, y1, x1 + width, y1 + height), stride)
    expected = []
    columns, rows = -(-width // stride), -(-height // stride)
    for v in range(y1 + (height - (rows - 1) * stride - 1) // 2, y1 + height, stride):
        for u in range(x1 + (width - (columns - 1) * stride - 1) // 2, x1 + width, stride):
            if 0 <= u < 64 and 0 <= v < 48:
                expected.append((u, v))
    assert list(zip(samples.u.tolist(), samples.v.tolist())) == expected


def test_boxes_of_any_size_cost_no_more_than_the_image():
    big = 2 ** 31 - 1
    samples = sample_median(flat(1000), (-big - 1, -big - 1, big, big))
    assert 0 < samples.u.size <= 12
    assert sample_median(flat(1000), (big - 50, big - 50, big, big)).u.size == 0


@pytest.mark.parametrize('rect', [(10, 10, 10, 20), (20, 10, 10, 20), (10, 20, 20, 10)])
def test_empty_and_reversed_boxes_are_refused(rect):
    with pytest.raises(ValueError, match=r'box \(%d, %d, %d, %d\)' % rect):
        sample_median(flat(1000), rect)


@pytest.mark.parametrize('depth,scale_m,dtype', [(0, 0.001, np.uint16), (np.nan, 1, np.float32),
                                                 (np.inf, 1, np.float32), (-1, 1, np.float32)])
def test_no_answer_without_measured_depth(depth, scale_m, dtype):
    samples = sample_median(flat(depth, scale_m, dtype), (0, 0, 64, 48))
    assert not samples.valid.any()
    assert estimate_median(samples, (0, 0, 64, 48), CAMERA) is None


def test_size_is_that_of_the_box_at_the_median_depth():
    rect = (10, 10, 40, 40)
    box = estimate_median(sample_median(flat(3000), rect, 5), rect, CAMERA)
    np.testing.assert_allclose(box.size_m, [30 / 60 * 3, 30 / 60 * 3, 30 / 60 * 3])
    assert box.support == 1.0 and not box.truncated and box.rect_px == rect


def test_units_do_not_matter():
    rect = (10, 10, 40, 44)
    millimetres = estimate_median(sample_median(flat(2500), rect, 5), rect, CAMERA)
    metres = estimate_median(sample_median(flat(2.5, 1.0, np.float32), rect, 5), rect, CAMERA)
    np.testing.assert_allclose(millimetres.center_m, metres.center_m, atol=1e-6)


def test_support_is_the_share_of_samples_on_the_body():
    depth = flat(2000)
    depth.values[:, 40:] = 4000
    depth.values[:10] = 0
    rect = (0, 0, 64, 48)
    box = estimate_median(sample_median(depth, rect, 1), rect, CAMERA)
    assert box.center_m[2] == pytest.approx(2.0)
    assert box.support == pytest.approx((40 / 64) * (38 / 48))


@pytest.mark.parametrize('rect,truncated', [((10, 10, 40, 40), False), ((0, 10, 40, 40), True),
                                            ((10, 1, 40, 40), True), ((10, 10, 63, 40), True),
                                            ((10, 10, 40, 48), True), ((-9, 10, 90, 40), True)])
def test_boxes_at_the_border_are_truncated(rect, truncated):
    assert is_truncated(rect, CAMERA) is truncated
