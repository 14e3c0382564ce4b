"""Input size of a network, and images in which it detects, with which it keeps up with a camera on this machine."""
import collections
import math
import statistics
import threading
from typing import Deque, List, Optional, Sequence, Tuple

from ros_3d_bb.core.time_sync import NS, median_period_ns

SIZES = 320, 384, 448, 512, 576, 640  # longer sides, pixels; multiples of 64, the largest stride
TARGET_PERIOD_S = 1 / 30.0  # faster cameras do not reduce the size further
WINDOW = 15  # images and detections of which the median is used
# Share of the period from which on detections are too slow. Durations vary: with a 95 % quantile of 1.6 medians, as
# measured in people_node, a share of 0.75 loses one of 500 images, 0.9 one of 40 (simulated, see its tests).
BUSY_SHARE = 0.75
FREE_SHARE = 0.6  # share of the period that a larger size may take, as estimated from its number of pixels; chosen
FASTER_SHARE = 0.9  # share of fewer periods that a detection may take before it is done in more images; chosen
PATIENCE, MAX_PATIENCE = 4, 512  # windows of images in a row with enough time before work is increased; chosen
SOON = 30  # windows of images; an increase that is undone within them did not pay; chosen
PERSON_M = 1.7  # height of a person
# Height of a person in the input from which on YOLOv5n finds 9 of 10 people of the thesis; it finds no more of them at
# 8 m in larger inputs. At 65 to 70 pixels 8, at 53 pixels 4. Measured:
# ./run bench detector --ranges 4 6 8 10 --sizes 256 320 384 448 512 640
MIN_PERSON_PX = 75


def sizes_for_range(range_m: float, focal_px: float, image_px: int) -> Tuple[int, ...]:
    """The `SIZES` in which a standing person at a range is at least `MIN_PERSON_PX` high; at least the largest one.

    `focal_px` is the focal length, and `image_px` the longer side of the images of the camera.
    """
    smallest = MIN_PERSON_PX * range_m * image_px / (PERSON_M * focal_px)
    return tuple(size for size in SIZES if size >= smallest) or SIZES[-1:]


class DetectionPace(object):
    """Chooses the largest size with which a detection takes less time than the period of the images.

    If the smallest size takes longer, detections take place in every n-th image, at a steady rate. An image with a
    detection has just arrived. If each detection began when the last one ends, the image would have waited for half a
    period on average. Therefore the newest result is not older on average, although detections are fewer: for a
    duration of d periods its age is d + n / 2 instead of d + 1 / 2 + d / 2, and n < d + 1.

    Work is reduced after one window of detections that are too slow, and increased after several in which there was
    enough time. Each time that an increase is soon undone, the next one has to wait for twice as many windows, so that
    size and rate do not oscillate, whatever the durations depend on.

    Attributes
    ----------
    size : int
        The longer side of the network's input, pixels; one of the sizes given, which are in increasing order.
    interval : int
        Number of images from one detection to the next.
    """

    def __init__(self, sizes: Sequence[int] = (0,)) -> None:
        self._lock = threading.Lock()
        self._stamps_ns: Deque[int] = collections.deque(maxlen=WINDOW)
        self._durations_s: List[float] = []
        self._sizes, self.size, self.interval = tuple(sizes), max(sizes), 1
        self._windows_with_time, self._patience = 0, PATIENCE
        self._windows_since_increase: Optional[int] = None
        self._detected_ns: Optional[int] = None  # stamp of the newest image for detection

    def use_sizes(self, sizes: Sequence[int]) -> None:
        """Choose from other sizes. The current one is kept if it is among them; otherwise the largest one is tried."""
        with self._lock:
            if tuple(sizes) != self._sizes:
                self._sizes = tuple(sizes)
                self._set(self.size if self.size in sizes else max(sizes), 1)

    def add_image(self, stamp_ns: int) -> bool:
        with self._lock:
            self._stamps_ns.append(stamp_ns)
            if self.interval > 1 and self._detected_ns is not None:
                passed_ns = stamp_ns - self._detected_ns  # negative if time jumped back
                if 0 <= passed_ns < (self.interval - 0.5) * median_period_ns(list(self._stamps_ns)):
                    return False
            self._detected_ns = stamp_ns
            return True

    def add_detection(self, duration_s: float) -> bool:
        """Add the duration of a detection with the current size. Returns whether size or interval changed."""
        with self._lock:
            self._durations_s.append(duration_s)
            if len(self._durations_s) < WINDOW or len(self._stamps_ns) < WINDOW:
                return False
            duration_s, self._durations_s = statistics.median(self._durations_s), []
            period_s = max(median_period_ns(list(self._stamps_ns)) / NS, 1e-3)
            if self._windows_since_increase is not None:
                self._windows_since_increase += self.interval
            reduced = self._reduced(duration_s, period_s)
            if reduced is not None:
                self._adapt_patience()
                self._set(*reduced)
                return True
            increased = self._increased(duration_s, period_s)
            self._windows_with_time = 0 if increased is None else self._windows_with_time + self.interval
            if increased is None or self._windows_with_time < self._patience:
                return False
            self._set(*increased)
            self._windows_since_increase = 0
            return True

    def _adapt_patience(self) -> None:
        """Double the patience if the last increase is undone soon; otherwise reset it."""
        if self._windows_since_increase is not None:
            was_soon = self._windows_since_increase <= SOON
            self._patience = min(2 * self._patience, MAX_PATIENCE) if was_soon else PATIENCE

    def _set(self, size: int, interval: int) -> None:
        self.size, self.interval = size, interval
        self._durations_s, self._windows_with_time, self._windows_since_increase = [], 0, None

    def _reduced(self, duration_s: float, period_s: float) -> Optional[Tuple[int, int]]:
        """Size and interval with less work, if detections take too long; else None."""
        longest_s = BUSY_SHARE * max(TARGET_PERIOD_S, period_s)
        smaller = [size for size in self._sizes if size < self.size]
        if smaller and duration_s > longest_s:
            return max([size for size in smaller if duration_s * (size / self.size) ** 2 < longest_s]
                       or smaller[:1]), self.interval
        interval = math.ceil(duration_s / period_s)
        return (self.size, interval) if interval > self.interval else None

    def _increased(self, duration_s: float, period_s: float) -> Optional[Tuple[int, int]]:
        """Size and interval with more work, if there is time for it; else None."""
        interval = math.ceil(duration_s / (FASTER_SHARE * period_s))
        if interval < self.interval:
            return self.size, interval
        larger = [size for size in self._sizes if size > self.size][:1]
        longest_s = FREE_SHARE * max(TARGET_PERIOD_S, period_s)
        if larger and duration_s * (larger[0] / self.size) ** 2 < longest_s:
            return larger[0], self.interval
        return None
