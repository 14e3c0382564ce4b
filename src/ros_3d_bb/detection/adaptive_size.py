"""Input size of a network that keeps up with the images of a camera on this machine."""
import collections
import statistics

from ros_3d_bb.core.time_sync import NS, median_period_ns

SIZES = 320, 416, 512, 640  # longer sides, pixels; multiples of 32
TARGET_PERIOD_S = 1 / 30.0  # faster cameras do not reduce the size further
WINDOW = 15  # images and detections over which times are averaged
BUSY_SHARE = 0.9  # share of the period from which on detections are too slow
FREE_SHARE = 0.7  # share of the period that a larger size may take, as estimated from its number of pixels
PATIENCE = 4  # number of windows in a row in which a larger size must fit


class AdaptiveSize(object):
    """Chooses the largest of `SIZES` with which detections take less time than the period of the images.

    The size is reduced after one window of detections that are too slow, and increased after several in which there was
    enough time, so that it does not follow short loads back and forth.

    Attributes
    ----------
    size : int
        The longer side of the network's input, pixels.
    """

    def __init__(self):
        self._index, self._windows_with_time = len(SIZES) - 1, 0
        self._stamps_ns, self._durations_s = collections.deque(maxlen=WINDOW), []

    @property
    def size(self):
        return SIZES[self._index]

    def add_image(self, stamp_ns):
        """Add the stamp of an image that arrived, whether or not it is processed."""
        self._stamps_ns.append(stamp_ns)

    def add_detection(self, duration_s):
        """Add the duration of a detection with the current size. Returns whether the size changed."""
        self._durations_s.append(duration_s)
        if len(self._durations_s) < WINDOW or len(self._stamps_ns) < WINDOW:
            return False
        period_s = max(TARGET_PERIOD_S, median_period_ns(list(self._stamps_ns)) / NS)
        share = statistics.median(self._durations_s) / period_s
        self._durations_s = []
        is_largest = self._index == len(SIZES) - 1
        has_time = not is_largest and share * (SIZES[self._index + 1] / self.size) ** 2 < FREE_SHARE
        self._windows_with_time = self._windows_with_time + 1 if has_time else 0
        if share > BUSY_SHARE and self._index > 0:
            self._index -= 1
        elif self._windows_with_time >= PATIENCE:
            self._index, self._windows_with_time = self._index + 1, 0
        else:
            return False
        return True
