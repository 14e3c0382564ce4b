"""Validation of sessions: readable images, boxes inside the image, plausible estimates and truth."""
import collections

from ros_3d_bb.sessions.session_reader import REJECTED, SessionError

HALF_PERSON_M = 0.5  # the body of a person whose axis is just outside the image may be visible


def problems_of(document):
    """Yield the problems of a document as lines of text. Rejected measurements are skipped."""
    document.estimates.complete()
    counts = collections.Counter(measurement.id for measurement in document.measurements)
    for name in sorted(name for name, count in counts.items() if count > 1):
        yield '%s: %d measurements have this id' % (name, counts[name])
    for index, measurement in enumerate(document.measurements):
        if measurement.state != REJECTED:
            for problem in _problems_at(document, index):
                yield '%s: %s' % (measurement.id or 'measurement number %d' % (index + 1), problem)


def _problems_at(document, index):
    measurement = document.measurements[index]
    if measurement.problem is not None:
        return [measurement.problem]
    try:
        document.color(index)
        document.depth(index)
    except SessionError as error:
        return [str(error)]
    boxes = _box_problems(document, index)
    return boxes or _estimate_problems(document, index) + list(_problems_of_truths(document, index))


def _box_problems(document, index):
    width, height = document.camera.width, document.camera.height
    detections = document.measurements[index].detections
    boxes_px = [detection.box_px for detection in detections if detection.box_px is not None]
    return ['box (%d, %d, %d, %d) is not inside the image of %d x %d pixels' % (x1, y1, x2, y2, width, height)
            for x1, y1, x2, y2 in boxes_px if not (0 <= x1 < x2 <= width and 0 <= y1 < y2 <= height)]


def _estimate_problems(document, index):
    """Problems of the person's box: it is missing, or it cannot be estimated from the images."""
    measurement, positions = document.measurements[index], document.estimates.of(index)
    if measurement.person is None:
        return ['nobody was found, and no box is drawn']
    if measurement.detections[measurement.person].box_px is None:
        return ['the person has no box'] if measurement.truths else []
    if positions[measurement.person] is None:
        return ['box (%d, %d, %d, %d) has not enough depth for an estimate'
                % measurement.detections[measurement.person].box_px]
    return []


def _problems_of_truths(document, index):
    outliers = document.estimates.implausible().get(index, {})
    for person, truth_m in document.measurements[index].truths.items():
        yield from view_problems(document, truth_m)
        if person in outliers:
            yield outliers[person].description


def truth_problems(document, index, truth_m):
    """Problems of a true position (x, y, z) before it is entered: lines of text, or an Outlier."""
    person = document.person_at(index, truth_m[0], truth_m[2])
    outlier = None if person is None else document.estimates.outlier(index, person, truth_m)
    if outlier is None:
        return view_problems(document, truth_m)
    positions = document.estimates.of(index)
    return view_problems(document, truth_m) + [outlier] + [
        'it would be plausible for box %d' % (other + 1) for other, position_m in enumerate(positions)
        if position_m is not None and document.estimates.outlier(index, other, truth_m) is None]


def view_problems(document, truth_m):
    """Problems of a true position (x, y, z) with the field of view of the camera."""
    x_m, _y_m, z_m = truth_m
    if not z_m > 0:
        return ['truth z is %g m; more than 0 expected' % z_m]
    left_m, right_m = document.camera.deproject(
        [(0, document.camera.cy), (document.camera.width, document.camera.cy)], z_m)[:, 0]
    if left_m - HALF_PERSON_M <= x_m <= right_m + HALF_PERSON_M:
        return []
    return ['truth x is %g m, outside the image, which shows %.2f to %.2f m at %g m' % (x_m, left_m, right_m, z_m)]
