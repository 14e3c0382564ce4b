"""Analyse the noise of measured positions: figures, normality tests, error models and a report."""
import argparse
import pathlib
import sys

from ros_3d_bb_lab.evaluation.noise.analysis import Inputs, analyse
from ros_3d_bb_lab.evaluation.noise.results import text_of, write_results
from ros_3d_bb_lab.evaluation.noise.tables import read_session_measurements, read_table


def main():
    """Run the command `./run noise`."""
    arguments = _arguments()
    try:
        inputs = _inputs(arguments)
        analysis = analyse(inputs)
        folder = pathlib.Path(arguments.out)
        write_results(folder, analysis)
    except (ValueError, OSError) as error:
        sys.exit('./run noise: %s' % error)
    print(text_of(analysis))
    print('report: %s' % (folder / 'report.html'))


def _inputs(arguments):
    """Read the measurements that the arguments name. Raises ValueError."""
    camera = arguments.camera
    if arguments.session:
        estimator = arguments.estimator or 'foreground'
        session = read_session_measurements(arguments.session, estimator)
        return Inputs(session, session, session.whole(), estimator, camera)
    z, x = read_table(arguments.z, 'Z'), read_table(arguments.x, 'X')
    x_variance = read_table(arguments.x_variance, 'X') if arguments.x_variance else x
    return Inputs(z, x, x_variance, arguments.estimator or '', camera)


def _arguments():
    parser = argparse.ArgumentParser(prog='./run noise', description=__doc__)
    parser.add_argument('session', nargs='?', help='folder of a measurement session; or else --z and --x')
    parser.add_argument('--z', metavar='CSV', help='table of the Z error, millimetres')
    parser.add_argument('--x', metavar='CSV', help='table of the X error')
    parser.add_argument('--x-variance', metavar='CSV', help='table for the variance of X, without people cut by the '
                        'edge of the image (default: that of --x)')
    parser.add_argument('--out', required=True, metavar='DIR', help='folder for the report; made where missing')
    parser.add_argument('--estimator', metavar='NAME', help='of a session: foreground (default), median, or recorded '
                        'for the estimates stored in it; of tables: the estimator of bbox3d_node that made their '
                        'positions (default: not said, for any)')
    parser.add_argument('--camera', default='unknown', help='a name to be kept in the error model')
    arguments = parser.parse_args()
    if bool(arguments.session) == bool(arguments.z or arguments.x or arguments.x_variance):
        parser.error('either a SESSION or tables expected')
    if not arguments.session and not (arguments.z and arguments.x):
        parser.error('both --z and --x expected')
    return arguments


if __name__ == '__main__':
    main()
