"""Estimated positions of a document, as the noise analysis computes them, and the errors that they make likely."""
import numpy as np

from ros_3d_bb.sessions.plausibility import likely_errors, outlier_of


class Estimates(object):
    """Estimates of the boxes of a document from its depth images; in the old format, the recorded positions.

    They are computed once for the boxes of a measurement. `known` and `outlier` use what has been computed.
    """

    def __init__(self, document):
        self._document, self._known, self._likely = document, {}, None

    def clear(self):
        """Forget all estimates, because images have changed."""
        self._known.clear()
        self._likely = None

    def update(self):
        """Adapt to changed measurements."""
        self._likely = None

    def of(self, index, depth=None):
        """Positions of the detections of a measurement, each (3,) or None. `depth` is its depth image, if it is read.
        """
        if self.known(index) is None:
            positions = tuple(self._document.positions(index, depth))
            self._known[index] = _boxes_of(self._document.measurements[index]), positions
            self._likely = None
        return self._known[index][1]

    def known(self, index):
        """Positions as from `of`, or None if they have not been computed for the current boxes."""
        boxes, positions = self._known.get(index, (None, None))
        return positions if boxes == _boxes_of(self._document.measurements[index]) else None

    def missing(self):
        """Yield the indices of annotated measurements whose estimates have not been computed."""
        for index, measurement in enumerate(self._document.measurements):
            if measurement.truths and self.known(index) is None:
                yield index

    def outlier(self, index, person, truth_m=None):
        """Outlier of a person with the true position (x, y, z), or None if it is plausible or there is no estimate.

        Without `truth_m` the stored truth is checked; otherwise the measurement is compared with the others only.
        """
        measurement, positions = self._document.measurements[index], self.known(index)
        is_stored = truth_m is None
        truth_m = measurement.truths.get(person) if is_stored else truth_m
        if truth_m is None or positions is None or positions[person] is None or measurement.rejected is not None:
            return None
        if is_stored and self._likely is None:
            self._likely = self._likely_without(None)
        likely = self._likely if is_stored else self._likely_without(index)
        return outlier_of(measurement.name, likely, positions[person][[0, 2]], _floor(truth_m))

    def _likely_without(self, excluded):
        pairs = []
        for index, measurement in enumerate(self._document.measurements):
            positions = self.known(index) if measurement.truths and index != excluded else None
            if positions is not None and measurement.rejected is None:
                pairs += [(positions[person][[0, 2]], _floor(truth_m))
                          for person, truth_m in measurement.truths.items() if positions[person] is not None]
        measured_m, truth_m = zip(*pairs) if pairs else ((), ())
        return likely_errors(measured_m, truth_m)


def _boxes_of(measurement):
    return tuple((detection.box_px, detection.by_hand) for detection in measurement.detections)


def _floor(truth_m):
    return np.array([truth_m[0], truth_m[2]])
