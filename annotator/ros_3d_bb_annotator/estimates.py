"""Estimated positions of a document, as the noise analysis computes them, and the errors that they make likely."""
import numpy as np

from ros_3d_bb.sessions.plausibility import likely_errors, outlier_of

MANY = 500  # measurements, of which a single one has no influence on the likely errors


class Estimates(object):
    """Estimates of the boxes of a document from its depth images, computed once for the boxes of a measurement.
    `known`, `outlier` and `implausible` use what has been computed.
    """

    def __init__(self, document):
        self._document, self._known = document, {}
        self.update()

    def update(self):
        """Adapt to changed measurements."""
        self._people = self._likely = self._implausible = None

    def of(self, index, depth=None):
        """Positions of the detections of a measurement, each (3,) or None. `depth` is its depth image, if it is read.
        """
        positions = self.known(index)
        if positions is None:
            positions = tuple(self._document.positions(index, depth))
            measurement = self._document.measurements[index]
            self._known[index] = measurement, positions
            if measurement.truths:
                self.update()
        return positions

    def known(self, index):
        """Positions as from `of`, or None if they have not been computed for the current boxes."""
        measurement, positions = self._known.get(index, (None, None))
        current = self._document.measurements[index]
        if measurement is current:
            return positions
        if measurement is None or _input_of(measurement) != _input_of(current):
            return None
        self._known[index] = current, positions
        return positions

    def missing(self):
        """Yield the indices of annotated measurements whose estimates have not been computed."""
        for index, measurement in enumerate(self._document.measurements):
            if measurement.truths and self.known(index) is None:
                yield index

    def implausible(self):
        """Detections with an implausible truth, {index: [detection, ...]}."""
        if self._implausible is None:
            people, measured_m, truth_m = self._annotated()
            plausible = self._likely_without(None).are_plausible(measured_m, truth_m) if people else ()
            self._implausible = {}
            for (index, person), is_plausible in zip(people, plausible):
                if not is_plausible:
                    self._implausible.setdefault(index, []).append(person)
        return self._implausible

    def outlier(self, index, person, truth_m=None):
        """Outlier of a person with the true position (x, y, z), or None if it is plausible or there is no estimate.

        Without `truth_m` the stored truth is checked; otherwise the measurement is compared with the others only.
        """
        measurement, positions = self._document.measurements[index], self.known(index)
        is_stored = truth_m is None
        if is_stored and person not in self.implausible().get(index, ()):
            return None
        truth_m = measurement.truths[person] if is_stored else truth_m
        if positions is None or positions[person] is None or (is_stored and measurement.rejected is not None):
            return None
        likely = self._likely_without(None if is_stored else index)
        return outlier_of(measurement.name, likely, positions[person][[0, 2]], np.array([truth_m[0], truth_m[2]]))

    def _annotated(self):
        """Pairs (index, detection) of annotated people with an estimate, measured and true (x, z), each (n, 2)."""
        if self._people is None:
            people, rows = [], []
            for index, measurement in enumerate(self._document.measurements):
                truths = measurement.truths if measurement.rejected is None else {}
                positions = self.known(index) if truths else None
                for person, truth_m in truths.items() if positions is not None else ():
                    if positions[person] is not None:
                        people.append((index, person))
                        rows.append((positions[person][0], positions[person][2], truth_m[0], truth_m[2]))
            rows = np.reshape(rows, (-1, 4)).astype(float)
            self._people = people, rows[:, :2], rows[:, 2:]
        return self._people

    def _likely_without(self, excluded):
        """LikelyErrors of all annotated people, or of those in measurements other than `excluded`."""
        people, measured_m, truth_m = self._annotated()
        if excluded is not None and len(people) <= MANY:
            others = np.array([index != excluded for index, _person in people], bool)
            if not others.all():
                return likely_errors(measured_m[others], truth_m[others])
        if self._likely is None:
            self._likely = likely_errors(measured_m, truth_m)
        return self._likely


def _input_of(measurement):
    """What the estimates of a measurement depend on. Another one may get the index of a deleted one."""
    return measurement.id, measurement.depth_path, tuple(
        (detection.box_px, detection.by_hand) for detection in measurement.detections)
