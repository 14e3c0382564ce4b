"""Tables of a session as CSV in millimetres; errors are measured minus true values.

The table has one row per annotated person. The form of the thesis has integers and columns for X and Z only. Both can
be read by `./run noise --z --x`.
"""
import csv
import io
import os

from ros_3d_bb.core.atomic_file import atomic_write
from ros_3d_bb.sessions.session_reader import SessionError
from ros_3d_bb_annotator.document import ESTIMATOR
from ros_3d_bb_annotator.measurement import ANNOTATED

RECORDED = 'recorded'
AXES = 'XYZ'
THESIS_COLUMNS = ('X measured', 'X true', 'Z measured', 'Z true', 'X error', 'X absolute error', 'Z error',
                  'Z absolute error')
COLUMNS = (('id', 'label', 'stamp', 'x1', 'y1', 'x2', 'y2', 'estimator')
           + tuple('%s %s' % (axis, kind) for kind in ('measured', 'recorded', 'true', 'error') for axis in AXES)
           + ('implausible',))


def default_estimator(document):
    """Estimator of the noise analysis; 'recorded' for the old format, which has no depth."""
    return RECORDED if document.is_old_format else ESTIMATOR


def rows_of(document, estimator):
    """Rows of COLUMNS of the people with truth and estimate, in the order of the session.

    `estimator` is that of the noise analysis, or 'recorded' for the stored estimates.
    """
    implausible = set((index, person) for index, person, _outlier in document.outliers())
    for index, person, position_m, truth_m in _people_of(document, estimator):
        measurement, detection = document.measurements[index], document.measurements[index].detections[person]
        recorded_m = detection.estimate_m if detection.estimate_m is not None else (None,) * 3
        errors_m = [None if None in pair else pair[0] - pair[1] for pair in zip(position_m, truth_m)]
        yield ((measurement.id, measurement.label, measurement.stamp_text) + (detection.box_px or ('',) * 4)
               + (estimator,) + tuple(_millimetres(value_m) for values_m in (position_m, recorded_m, truth_m, errors_m)
                                      for value_m in values_m)
               + ('yes' if (index, person) in implausible else '',))


def thesis_rows_of(document, estimator):
    """Rows of THESIS_COLUMNS, ints, sorted by the measured values."""
    return sorted(_thesis_row(position_m, truth_m)
                  for _index, _person, position_m, truth_m in _people_of(document, estimator))


def export(document, path, estimator, in_thesis_form=False):
    """Write a table to a CSV file atomically, and return the number of rows.

    Raises SessionError if no measurement is annotated, or the file cannot be written.
    """
    rows = list((thesis_rows_of if in_thesis_form else rows_of)(document, estimator))
    if not rows:
        raise SessionError('%s: no annotated measurement with an estimate; there is nothing to export'
                           % document.folder)
    text = io.StringIO()
    writer = csv.writer(text, lineterminator='\n')
    writer.writerow(THESIS_COLUMNS if in_thesis_form else COLUMNS)
    writer.writerows(rows)
    try:
        atomic_write(os.path.abspath(path), text.getvalue().encode())
    except OSError as error:
        raise SessionError('%s: cannot be written (%s)' % (path, error.strerror))
    return len(rows)


def _people_of(document, estimator):
    """Yield index, detection, estimate (3,) and truth (x, y, z) of the annotated people with an estimate."""
    for index, measurement in enumerate(document.measurements):
        if measurement.state != ANNOTATED:
            continue
        positions = ([detection.estimate_m for detection in measurement.detections] if estimator == RECORDED
                     else document.estimates.of(index))
        for person, truth_m in sorted(measurement.truths.items()):
            if positions[person] is not None:
                yield index, person, positions[person], truth_m


def _thesis_row(position_m, true_m):
    (x, z), (true_x, true_z) = ([int(round(1000 * float(values_m[axis]))) for axis in (0, 2)]
                                for values_m in (position_m, true_m))
    return x, true_x, z, true_z, x - true_x, abs(x - true_x), z - true_z, abs(z - true_z)


def _millimetres(value_m):
    return '' if value_m is None else '%.10g' % (round(1000 * float(value_m), 1) + 0.0)
