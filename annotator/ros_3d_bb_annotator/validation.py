"""Validation of sessions: readable images, boxes inside the image, plausible estimates and truth."""
import collections
import os
import pathlib

from ros_3d_bb.sessions.session_reader import SessionError, read_description
from ros_3d_bb_annotator.measurement import ANNOTATED, REJECTED

MAX_ERROR_M = 1.0  # a larger error means that the estimate is of another person, or the truth of another place
HALF_PERSON_M = 0.5  # the body of a person whose axis is just outside the image may be visible


def problems_of(document):
    """Yield the problems of a document as lines of text. Rejected measurements are skipped."""
    counts = collections.Counter(measurement.id for measurement in document.measurements)
    for name in sorted(name for name, count in counts.items() if count > 1):
        yield '%s: %d measurements have this id' % (name, counts[name])
    for index, measurement in enumerate(document.measurements):
        if measurement.state != REJECTED:
            for problem in _problems_at(document, index):
                yield '%s: %s' % (measurement.id or 'measurement number %d' % (index + 1), problem)


def leftovers_of(document):
    """Sorted relative paths of files that no measurement refers to, such as those left by a killed program."""
    if document.is_old_format:
        return []
    folder = pathlib.Path(document.folder)
    paths = [*folder.glob('.*.tmp'), *folder.glob('color/*'), *folder.glob('depth/*')]
    # read after the files are listed, because a viewer may add measurements concurrently
    entries = [entry for entry in read_description(folder)['frames'] if isinstance(entry, dict)]
    used = set(os.path.normpath(str(entry.get(kind, ''))) for entry in entries for kind in ('color', 'depth'))
    return sorted(set(str(path.relative_to(folder)) for path in paths) - used)


def _problems_at(document, index):
    measurement = document.measurements[index]
    if measurement.problem is not None:
        return [measurement.problem]
    try:
        document.color(index)
        if document.is_old_format:
            document.stretched_depth(index)
            return _truth_problems(document, index)
        document.depth(index)
    except SessionError as error:
        return [str(error)]
    boxes = _box_problems(document, index)
    return boxes or _estimate_problems(document, index) + _truth_problems(document, index)


def _box_problems(document, index):
    width, height = document.camera.width, document.camera.height
    detections = document.measurements[index].detections
    boxes_px = [detection.box_px for detection in detections if detection.box_px is not None]
    return ['box (%d, %d, %d, %d) is not inside the image of %d x %d pixels' % (x1, y1, x2, y2, width, height)
            for x1, y1, x2, y2 in boxes_px if not (0 <= x1 < x2 <= width and 0 <= y1 < y2 <= height)]


def _estimate_problems(document, index):
    """Problems of the person's box: it is missing, or it cannot be estimated from the images."""
    measurement = document.measurements[index]
    box_px = None if measurement.person is None else measurement.detections[measurement.person].box_px
    if box_px is None:
        return ['no person is detected, and no box is drawn'] if measurement.state == ANNOTATED else []
    if document.estimated(index, box_px) is None:
        return ['box (%d, %d, %d, %d) has not enough depth for an estimate' % box_px]
    return []


def _truth_problems(document, index):
    """Problems of the truth: it is outside the field of view, or far from the estimate."""
    camera, truth_m, errors_m = document.camera, document.measurements[index].truth_m, document.errors(index)
    if truth_m is None:
        return []
    x_m, _y_m, z_m = truth_m
    if not z_m > 0:
        return ['truth z is %g m; more than 0 expected' % z_m]
    problems = []
    if camera is not None:
        left_m, right_m = camera.deproject([(0, camera.cy), (camera.width, camera.cy)], z_m)[:, 0]
        if not left_m - HALF_PERSON_M <= x_m <= right_m + HALF_PERSON_M:
            problems.append('truth x is %g m, outside the image, which shows %.2f to %.2f m at %g m'
                            % (x_m, left_m, right_m, z_m))
    if errors_m is not None and errors_m[2] > MAX_ERROR_M:
        problems.append('truth and estimate are %.2f m apart' % errors_m[2])
    return problems
