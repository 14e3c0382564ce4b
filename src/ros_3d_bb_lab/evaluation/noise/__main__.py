"""Analyse the noise of measured positions: figures, normality tests, error models and a report."""
import argparse
import pathlib
import sys

from ros_3d_bb_lab.evaluation.noise.analysis import Inputs, analyse
from ros_3d_bb_lab.evaluation.noise.report import text_of, write_results
from ros_3d_bb_lab.evaluation.noise.tables import read_session_measurements, read_table


def main():
    """Run the command `./run noise`."""
    arguments = _arguments()
    folder = pathlib.Path(arguments.out)
    try:
        inputs = _inputs(arguments)
        for outlier in inputs.outliers:
            print('left out of the analysis:', outlier, file=sys.stderr)
        analysis = analyse(inputs)
        write_results(folder, analysis)
    except (ValueError, OSError) as error:
        sys.exit('./run noise: %s' % error)
    print(text_of(analysis))
    print('report: %s (and report.pdf)' % (folder / 'report.html'))


def _inputs(arguments):
    """Read the measurements that the arguments name. Raises ValueError."""
    if arguments.session:
        estimator = arguments.estimator or 'foreground'
        session = read_session_measurements(arguments.session, estimator)
        return Inputs.of_session(session, estimator, arguments.camera)
    z, x = read_table(arguments.z, 'Z'), read_table(arguments.x, 'X')
    x_variance = read_table(arguments.x_variance, 'X') if arguments.x_variance else x
    return Inputs.of_tables(z, x, x_variance, arguments.estimator or '', arguments.camera)


def _arguments():
    parser = argparse.ArgumentParser(prog='./run noise', description=__doc__)
    parser.add_argument('session', nargs='?', help='folder of a measurement session; or use --z and --x')
    parser.add_argument('--z', metavar='CSV', help='table of the Z error, millimetres')
    parser.add_argument('--x', metavar='CSV', help='table of the X error')
    parser.add_argument('--x-variance', metavar='CSV', help='table for the variance of X, without people truncated by '
                        'the image border (default: that of --x)')
    parser.add_argument('--out', required=True, metavar='DIR', help='folder for the report; created if missing')
    parser.add_argument('--estimator', metavar='NAME', help='for a session: foreground (default), median, or recorded '
                        'for the stored estimates; for tables: the estimator of bbox3d_node that computed them '
                        '(default: any)')
    parser.add_argument('--camera', default='unknown', help='name stored in the error model')
    arguments = parser.parse_args()
    if bool(arguments.session) == bool(arguments.z or arguments.x or arguments.x_variance):
        parser.error('either a SESSION or tables expected')
    if not arguments.session and not (arguments.z and arguments.x):
        parser.error('both --z and --x expected')
    return arguments


if __name__ == '__main__':
    main()
