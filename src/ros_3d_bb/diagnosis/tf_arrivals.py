"""Arrival of transforms: whether their stamps agree with those of the images, and whether they arrive in time."""
import collections

import numpy as np

from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.diagnosis.observations import KEPT


class TfArrivals(object):
    """Stamps and arrival times, in ROS time, of the transforms on /tf, by child frame."""

    def __init__(self):
        self._received_ns = collections.defaultdict(lambda: collections.deque(maxlen=KEPT))

    def add(self, transform, ros_ns):
        """Add the arrival of a TransformStamped; 0, before the first /clock message, is ignored."""
        if ros_ns:
            self._received_ns[transform.child_frame_id.lstrip('/')].append((transform.header.stamp.to_nsec(), ros_ns))

    def lags_s(self, frames):
        """Return the median of arrival minus stamp, in seconds, of the transforms of some frames, by frame."""
        received_ns = {frame: np.array(list(self._received_ns[frame]))
                       for frame in frames if frame in self._received_ns}
        return {frame: float(np.median(pairs[:, 1] - pairs[:, 0])) / NS for frame, pairs in received_ns.items()}

    def share_in_time(self, frames, images_ns, timeout_s):
        """Return the share of images, (stamp, arrival), for which all frames have transforms around the stamp at most
        `timeout_s` after the arrival of the image; None without any. Images at the end, whose transforms may follow,
        do not count.
        """
        in_time = []
        for pairs_ns in (list(self._received_ns[frame]) for frame in frames if frame in self._received_ns):
            stamps_ns, arrivals_ns = np.array(pairs_ns).T
            by_deadline = [(stamps_ns[arrivals_ns <= arrival_ns + timeout_s * NS], stamp_ns)
                           for stamp_ns, arrival_ns in images_ns if arrival_ns + timeout_s * NS <= arrivals_ns[-1]]
            in_time.append(np.mean([len(known) > 0 and known.min() <= stamp_ns <= known.max()
                                    for known, stamp_ns in by_deadline]) if by_deadline else 1.0)
        return min(in_time, default=None)
