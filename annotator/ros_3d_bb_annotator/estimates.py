"""Estimated positions of a document, as the noise analysis computes them, and the errors that they make likely."""
import contextlib

import numpy as np

from ros_3d_bb.estimation.box3d_estimator import estimator_named
from ros_3d_bb.estimation.error_model import RECORDED
from ros_3d_bb.sessions.plausibility import likely_errors, outlier_of, outliers_of
from ros_3d_bb.sessions.session_reader import ANNOTATED

ESTIMATOR = 'foreground'  # the default of bbox3d_node


class Estimates(object):
    """Estimates of the boxes of a document from its depth images, computed once for the boxes of a measurement.
    `known` and `implausible` use what has been computed.
    """

    def __init__(self, document):
        self._document, self._known = document, {}
        self.update()

    def update(self):
        self._people = self._implausible = None

    def of(self, index, depth=None):
        """Positions of the detections of a measurement, each (3,) or None. `depth` is its depth image, if it is read.
        """
        positions, measurement = self.known(index), self._document.measurements[index]
        if positions is None:
            if depth is None:
                with contextlib.suppress(ValueError):
                    depth = self._document.depth(index)
            positions = tuple(None if depth is None else self._position(measurement._replace(person=person), depth)
                              for person in range(len(measurement.detections)))
            self._known[_input_of(measurement)] = positions
            if measurement.truths:
                self.update()
        return positions

    def known(self, index):
        """Positions as from `of`, or None if they have not been computed for the current boxes."""
        return self._known.get(_input_of(self._document.measurements[index]))

    def missing(self):
        """Yield the indices of annotated measurements whose estimates have not been computed."""
        for index, measurement in enumerate(self._document.measurements):
            if measurement.truths and self.known(index) is None:
                yield index

    def complete(self):
        for index in self.missing():
            self.of(index)

    def implausible(self):
        """Outliers among the people with truth and estimate, {index: {detection: Outlier}}."""
        if self._implausible is None:
            people, measured_m, truth_m = self._annotated()
            names = [self._document.measurements[index].name for index, _person in people]
            self._implausible = {}
            for (index, person), outlier in zip(people, outliers_of(names, measured_m, truth_m)):
                if outlier is not None:
                    self._implausible.setdefault(index, {})[person] = outlier
        return self._implausible

    def outlier(self, index, person, truth_m):
        """Outlier of a person with a new true position (x, y, z), compared with the other measurements.

        None if the position is plausible, or there is no estimate.
        """
        position_m = self.of(index)[person]
        if position_m is None:
            return None
        people, measured_m, others_m = self._annotated()
        others = np.array([other != index for other, _person in people], bool)
        return outlier_of(self._document.measurements[index].name, likely_errors(measured_m[others], others_m[others]),
                          position_m[[0, 2]], np.array(truth_m[::2]))

    def _position(self, measurement, depth):
        box = measurement.estimate(depth, self._document.camera, estimator_named(ESTIMATOR))
        return None if box is None else box.center_m

    def people(self, estimator=ESTIMATOR):
        """Yield index, detection, estimate (3,) and truth (x, y, z) of the annotated people with a known estimate.

        `estimator` is that of the noise analysis, or 'recorded' for the stored estimates.
        """
        for index, measurement in enumerate(self._document.measurements):
            if measurement.state == ANNOTATED:
                recorded = [detection.estimate_m for detection in measurement.detections]
                positions = recorded if estimator == RECORDED else self.known(index)
                for person, truth_m in sorted(measurement.truths.items()):
                    if positions is not None and positions[person] is not None:
                        yield index, person, positions[person], truth_m

    def _annotated(self):
        """Pairs (index, detection) of the annotated people, measured and true (x, z), each (n, 2)."""
        if self._people is None:
            people = list(self.people())
            measured_m, truth_m = (np.reshape([one[column][::2] for one in people], (-1, 2)) for column in (2, 3))
            self._people = [one[:2] for one in people], measured_m.astype(float), truth_m.astype(float)
        return self._people


def _input_of(measurement):
    """What the estimates of a measurement depend on. Another one may get the index of a deleted one."""
    return measurement.id, measurement.depth_path, tuple(
        (detection.box_px, detection.by_hand) for detection in measurement.detections)
