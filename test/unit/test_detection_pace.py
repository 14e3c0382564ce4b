"""The pace of detections of simulated durations, in images of a simulated camera."""
import numpy as np
import pytest

from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.core.detection_pace import MAX_PATIENCE, SIZES, WINDOW, DetectionPace, sizes_for_range


def detected(pace, duration_of, seconds, rate_hz=30.0, start_s=0.0):
    """Images with a detection, [(stamp, start of the detection, size, interval), ...], in seconds.

    As in the nodes, the newest image waits while there is a detection in another, and others are skipped.
    `duration_of(size, interval, time)` are seconds.
    """
    found, waiting, free_s = [], None, start_s

    def begin(stamp_s, begins_s):
        found.append((stamp_s, begins_s, pace.size, pace.interval))
        duration_s = duration_of(pace.size, pace.interval, begins_s)
        pace.add_detection(duration_s)
        return begins_s + duration_s

    for number in range(int(seconds * rate_hz)):
        stamp_s = start_s + number / rate_hz
        if waiting is not None and free_s <= stamp_s:
            free_s, waiting = begin(waiting, free_s), None
        if pace.add_image(int(stamp_s * NS)):
            waiting = stamp_s
            if free_s <= stamp_s:
                free_s, waiting = begin(stamp_s, stamp_s), None
    return found


def by_pixels(largest_s):
    """Durations that are proportional to the number of pixels."""
    return lambda size, _interval, _time_s: largest_s * (size / SIZES[-1]) ** 2


def changes(found):
    levels = [entry[2:] for entry in found]
    return sum(before != after for before, after in zip(levels, levels[1:]))


@pytest.mark.parametrize('largest_s, rate_hz, size, interval', [
    (0.024, 30, 640, 1), (0.034, 30, 512, 1), (0.045, 30, 448, 1), (0.1, 30, 320, 1), (0.048, 15, 640, 1),
    (0.024, 90, 640, 3), (0.2, 30, 320, 2), (1.0, 30, 320, 8)])
def test_the_pace_is_the_largest_size_and_the_highest_steady_rate_that_keep_up(largest_s, rate_hz, size, interval):
    found = detected(DetectionPace(SIZES), by_pixels(largest_s), 120, rate_hz)
    assert found[0][2:] == (640, 1) and found[-1][2:] == (size, interval)
    assert changes(found) <= 2
    stamps_s, begin_s = np.array(found[-200:])[:, :2].T
    np.testing.assert_allclose(np.diff(stamps_s) * rate_hz, interval)  # no image missing, even gaps
    np.testing.assert_allclose(begin_s, stamps_s)  # the newest image


def test_one_size_reduces_the_rate_only_and_one_slow_detection_changes_nothing():
    found = detected(DetectionPace(), lambda *_state: 0.08, 10)
    assert found[-1][2:] == (0, 3) and changes(found) == 1
    found = detected(DetectionPace(SIZES), lambda _size, _interval, time_s: 3.0 if time_s == 1.0 else 0.02, 10)
    assert changes(found) == 0


def test_size_and_rate_increase_again_after_each_load():
    pace = DetectionPace(SIZES)
    for start_s in range(0, 600, 60):
        assert detected(pace, by_pixels(0.3), 20, start_s=start_s)[-1][2:] == (320, 3)
        assert detected(pace, by_pixels(0.018), 40, start_s=start_s + 20)[-1][2:] == (640, 1)


@pytest.mark.parametrize('duration_of', [
    lambda size, _interval, _time_s: {640: 0.034, 576: 0.015}.get(size, 0.01),  # more than proportional to the pixels
    lambda _size, interval, _time_s: 0.035 if interval == 1 else 0.025])  # a rate that slows down other programs
def test_size_and_rate_do_not_oscillate_whatever_the_durations_depend_on(duration_of):
    """Undone increases become rarer, down to one in `MAX_PATIENCE` windows."""
    found = detected(DetectionPace(SIZES if duration_of(576, 1, 0) < 0.03 else (640,)), duration_of, 1200)
    assert changes(found) <= 2 * (np.log2(MAX_PATIENCE) + 1200 * 30 / (MAX_PATIENCE * WINDOW))
    assert changes([entry for entry in found if entry[0] > 600]) <= 6


@pytest.mark.parametrize('largest_s', [0.025, 0.03, 0.04, 0.05])
def test_noisy_durations_cause_few_changes_and_few_lost_images(largest_s):
    """The durations have a 95 % quantile of 1.6 medians, as those measured in people_node."""
    random = np.random.RandomState(0)
    found = detected(DetectionPace(SIZES), lambda size, _interval, _time_s: (
        largest_s * (size / SIZES[-1]) ** 2 * random.lognormal(0, 0.28)), 600)
    assert changes(found) <= 10 and len(found) > 0.997 * 600 * 30


def test_a_jump_back_in_time_does_not_stop_the_detections():
    pace = DetectionPace()
    assert detected(pace, lambda *_state: 0.08, 10, start_s=1000)[-1][3] == 3
    assert len(detected(pace, lambda *_state: 0.08, 10)) >= 99


def test_people_in_range_are_high_enough_in_the_smallest_input():
    """The D435i of the thesis in two resolutions, and a wide-angle camera."""
    assert sizes_for_range(8, 614.7, 640) == (384, 448, 512, 576, 640)
    assert sizes_for_range(6, 614.7, 640) == SIZES
    assert sizes_for_range(8, 922, 1280) == (512, 576, 640)
    assert sizes_for_range(8, 300, 640) == (640,)
