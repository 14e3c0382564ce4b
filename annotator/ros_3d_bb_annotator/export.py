"""Results of a session: the noise analysis, and a table as CSV in millimetres, which `./run noise --z --x` reads.

The table has one row per annotated person. Errors are measured minus true values.
"""
import csv
import io
import os
import pathlib

from ros_3d_bb.core.atomic_file import atomic_write
from ros_3d_bb.sessions.session_reader import SessionError

AXES = 'XYZ'
COLUMNS = (('id', 'label', 'stamp', 'x1', 'y1', 'x2', 'y2', 'estimator')
           + tuple('%s %s' % (axis, kind) for kind in ('measured', 'recorded', 'true', 'error') for axis in AXES)
           + ('implausible',))


def rows_of(document, estimator):
    """Rows of COLUMNS of the people with truth and estimate, in the order of the session.

    `estimator` is that of the noise analysis, or 'recorded' for the stored estimates.
    """
    document.estimates.complete()
    implausible = document.estimates.implausible()
    for index, person, position_m, truth_m in document.estimates.people(estimator):
        measurement, detection = document.measurements[index], document.measurements[index].detections[person]
        recorded_m = detection.estimate_m if detection.estimate_m is not None else (None,) * 3
        errors_m = [None if None in pair else pair[0] - pair[1] for pair in zip(position_m, truth_m)]
        yield ((measurement.id, measurement.label, measurement.stamp_text) + (detection.box_px or ('',) * 4)
               + (estimator,) + tuple(_millimetres(value_m) for values_m in (position_m, recorded_m, truth_m, errors_m)
                                      for value_m in values_m)
               + ('yes' if person in implausible.get(index, ()) else '',))


def export(document, path, estimator):
    """Write the table to a CSV file. Returns the number of rows. Raises SessionError if there are none, or it fails."""
    rows = list(rows_of(document, estimator))
    if not rows:
        raise SessionError('%s: no annotated measurement with an estimate; there is nothing to export'
                           % document.folder)
    text = io.StringIO()
    writer = csv.writer(text, lineterminator='\n')
    writer.writerow(COLUMNS)
    writer.writerows(rows)
    try:
        atomic_write(os.path.abspath(path), text.getvalue().encode())
    except OSError as error:
        raise SessionError('%s: cannot be written (%s)' % (path, error.strerror))
    return len(rows)


def analyse(session, folder, estimator):
    """Write report, figures and error model of the annotated measurements of a session to a folder.

    By default it is `analysis` in the session. `estimator` is 'foreground', 'median', or 'recorded' for the stored
    estimates. Returns the Analysis of the lab, and the folder (pathlib.Path). Raises ValueError if there are too few
    measurements.
    """
    from ros_3d_bb_lab.evaluation.noise import analysis, report, tables  # optional scipy and matplotlib take a second
    folder = pathlib.Path(folder or os.path.join(session, 'analysis'))
    table = tables.read_session_measurements(session, estimator)
    found = analysis.analyse(analysis.Inputs.of(table, table, table, estimator, 'unknown'))
    report.write_results(folder, found)
    return found, folder


def _millimetres(value_m):
    return '' if value_m is None else '%.10g' % (round(1000 * float(value_m), 1) + 0.0)
