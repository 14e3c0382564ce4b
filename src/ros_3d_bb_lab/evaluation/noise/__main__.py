"""Analyse the noise of measured positions: figures, a normality test, an error model and a report.

With --recordings, fit an error model to recorded 3D boxes of moving people with ground truth. Only this measures the
section `detector` of the model; sessions and tables write its defaults.
"""
import argparse
import pathlib
import sys

from ros_3d_bb.estimation.error_model import RECORDED, write_error_model
from ros_3d_bb_lab.evaluation.noise.analysis import Inputs, analyse
from ros_3d_bb_lab.evaluation.noise.recordings import fit_recordings
from ros_3d_bb_lab.evaluation.noise.report import write_results
from ros_3d_bb_lab.evaluation.noise.tables import read_session_measurements, read_table
from ros_3d_bb_lab.evaluation.tracking.recorded_detections import read_recordings


def main():
    arguments = _arguments()
    folder = pathlib.Path(arguments.out)
    try:
        if arguments.recordings:
            return _fit_recordings(arguments, folder)
        analysis = analyse(_inputs(arguments))
        write_results(folder, analysis)
    except (ValueError, OSError) as error:
        sys.exit('./run noise: %s' % error)
    analysis.print_results(folder)


def _fit_recordings(arguments, folder):
    """Write the error model of recordings, and print its values for the tracker. Raises ValueError or OSError."""
    runs = list(read_recordings(arguments.recordings))
    model = fit_recordings(runs, ', '.join(run.name for run in runs), arguments.camera)
    folder.mkdir(parents=True, exist_ok=True)
    write_error_model(folder / 'error_model.yaml', model)
    print('%d errors of %d people, RMSE after correction, people left out: %.3f m'
          % (model.provenance.measurements, model.provenance.positions, model.cross_validated.rmse_plane_m))
    for name, value in model.detector._asdict().items():
        print('%s: %s' % (name, 'unknown' if value is None else '%.3g' % value))
    print('error model: %s' % (folder / 'error_model.yaml'))


def _inputs(arguments):
    if arguments.session:
        estimator = arguments.estimator or 'foreground'
        z = x = x_variance = read_session_measurements(arguments.session, estimator)
    else:
        estimator, z, x = arguments.estimator or '', read_table(arguments.z, 'Z'), read_table(arguments.x, 'X')
        x_variance = read_table(arguments.x_variance, 'X') if arguments.x_variance else x
    return Inputs.of(z, x, x_variance, estimator, arguments.camera)


def _arguments():
    parser = argparse.ArgumentParser(prog='./run noise', description=__doc__)
    parser.add_argument('session', nargs='?', help='folder of a measurement session; or use --z and --x')
    parser.add_argument('--recordings', metavar='DIR', help='recorded 3D boxes with ground truth instead, as of '
                        './run bench tracking --detections')
    parser.add_argument('--z', metavar='CSV', help='table of the Z error, millimetres')
    parser.add_argument('--x', metavar='CSV', help='table of the X error')
    parser.add_argument('--x-variance', metavar='CSV', help='table for the variance of X, without people truncated by '
                        'the image border (default: that of --x)')
    parser.add_argument('--out', required=True, metavar='DIR', help='folder for the report; created if missing')
    parser.add_argument('--estimator', choices=('foreground', 'median', RECORDED), help='for a session: foreground '
                        '(default), median, or recorded for the stored estimates; for tables: the estimator of '
                        'bbox3d_node that computed them (default: any)')
    parser.add_argument('--camera', default='unknown', help='name stored in the error model')
    arguments = parser.parse_args()
    tables = arguments.z or arguments.x or arguments.x_variance
    if bool(arguments.session) + bool(arguments.recordings) + bool(tables) != 1:
        parser.error('either a SESSION, --recordings or tables expected')
    if tables and not (arguments.z and arguments.x):
        parser.error('both --z and --x expected')
    if arguments.estimator and arguments.recordings:
        parser.error('--estimator is for a session and for tables')
    return arguments


if __name__ == '__main__':
    main()
