"""Analyse the noise of measured positions: figures, normality tests, error models and a report."""
import argparse
import json
import pathlib
import sys

from ros_3d_bb.error_model import write_error_model
from ros_3d_bb.evaluation.noise.analysis import Inputs, analyse, summary_of
from ros_3d_bb.evaluation.noise.figures import polynomial_text, write_figures
from ros_3d_bb.evaluation.noise.report import report_of
from ros_3d_bb.evaluation.noise.tables import clusters_of, read_session_measurements, read_table


def main():
    """The command `./run noise`."""
    arguments = _arguments()
    try:
        inputs = _inputs(arguments)
        analysis = analyse(inputs)
        folder = pathlib.Path(arguments.out)
        folder.mkdir(parents=True, exist_ok=True)
        write_results(folder, analysis)
    except (ValueError, OSError) as error:
        sys.exit('./run noise: %s' % error)
    for name, axis, variances in (('z', analysis.z, analysis.z), ('x', analysis.x, analysis.x_variance)):
        print('f(%s) = %s, largest variance %.5f m², standard deviation %.4f m'
              % (name, polynomial_text(axis.poly, name), variances.max_variance_m2, variances.max_sigma_m))
    print('report: %s' % (folder / 'report.html'))


def write_results(folder, analysis):
    """Write the report with its figures, summary.json and the error models into a folder (pathlib)."""
    write_figures(folder, analysis, clusters_of(analysis.inputs.z, 'Z'), clusters_of(analysis.inputs.x_variance, 'X'))
    (folder / 'report.html').write_text(report_of(analysis), encoding='utf-8')
    (folder / 'summary.json').write_text(json.dumps(summary_of(analysis), indent=1), encoding='utf-8')
    for name, model in (('error_model_thesis_form.yaml', analysis.thesis_form),
                        ('error_model.yaml', analysis.model or analysis.thesis_form)):
        if model is not None:
            write_error_model(folder / name, model)


def _inputs(arguments):
    """The measurements that the arguments name. Raises ValueError."""
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
