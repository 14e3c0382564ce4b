"""The input size follows the time of the detections."""
import pytest

from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.detection.adaptive_size import PATIENCE, SIZES, WINDOW, AdaptiveSize


def sizes_of(detections, largest_s, rate_hz=30.0, sizes=None):
    """Sizes after each of some detections, whose duration is proportional to the number of pixels."""
    sizes, found = sizes or AdaptiveSize(), []
    for number in range(detections):
        sizes.add_image(int(number * NS / rate_hz))
        before = sizes.size
        changed = sizes.add_detection(largest_s * (before / SIZES[-1]) ** 2)
        assert changed == (sizes.size != before)
        found.append(sizes.size)
    return found


@pytest.mark.parametrize('largest_s, rate_hz, size', [
    (0.028, 30, 640), (0.034, 30, 512), (0.06, 30, 416), (0.1, 30, 320), (1.0, 30, 320), (0.06, 15, 640),
    (0.028, 90, 640)])
def test_the_size_is_the_largest_that_keeps_up_with_the_images(largest_s, rate_hz, size):
    found = sizes_of(4 * WINDOW, largest_s, rate_hz)
    assert set(found[:WINDOW - 1]) == {640} and found[-1] == size
    assert sizes_of(100 * WINDOW, largest_s, rate_hz)[-1] == size  # stable


def test_the_size_grows_again_after_a_load():
    sizes = AdaptiveSize()
    assert sizes_of(2 * WINDOW, 0.06, sizes=sizes)[-1] == 416
    found = sizes_of(2 * PATIENCE * WINDOW, 0.02, sizes=sizes)
    assert found[(PATIENCE - 1) * WINDOW] == 416 and found[-1] == 640


def test_one_slow_detection_changes_nothing():
    sizes = AdaptiveSize()
    sizes_of(WINDOW - 1, 0.02, sizes=sizes)
    sizes.add_image(10 * NS)
    assert not sizes.add_detection(3.0) and sizes.size == 640
