"""Table of a session in the format of the thesis: integer millimetres, errors are measured minus true values."""
import csv
import io
import os

from ros_3d_bb.core.atomic_file import atomic_write
from ros_3d_bb.sessions.session_reader import SessionError
from ros_3d_bb_annotator.measurement import ANNOTATED

COLUMNS = ('X measured', 'X true', 'Z measured', 'Z true', 'X error', 'X absolute error', 'Z error', 'Z absolute error')


def rows_of(document):
    """Rows of the annotated measurements with an estimate, ints in millimetres, sorted by the measured values."""
    return sorted(_row(measurement) for measurement in document.measurements
                  if measurement.state == ANNOTATED and measurement.estimate_m is not None)


def export(document, path):
    """Write the table to a CSV file atomically, and return the number of rows.

    Raises SessionError if no measurement is annotated, or the file cannot be written.
    """
    rows = rows_of(document)
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


def _row(measurement):
    (x, z), (true_x, true_z) = ([int(round(1000 * float(position_m[axis]))) for axis in (0, 2)]
                                for position_m in (measurement.estimate_m, measurement.truth_m))
    return x, true_x, z, true_z, x - true_x, abs(x - true_x), z - true_z, abs(z - true_z)
