"""Annotate the measurements of a session with ground truth in a window; or export or analyse the session."""
import argparse
import sys

from ros_3d_bb_annotator.document import Document
from ros_3d_bb_annotator.estimates import ESTIMATOR
from ros_3d_bb_annotator.export import analyse, export


def main(arguments=None):
    """Run the command `annotator`. Returns the exit status, 1 if the session cannot be used."""
    arguments = _arguments(arguments)
    if not (arguments.export or arguments.analyse):
        return _show(arguments.session)
    estimator = arguments.estimator or ESTIMATOR
    try:
        if arguments.export:
            count = export(Document(arguments.session), arguments.export, estimator)
            print('%s: %d rows' % (arguments.export, count))
        else:
            analysis, folder = analyse(arguments.session, arguments.out, estimator)
            analysis.print_results(folder)
    except (ValueError, OSError) as error:
        print('annotator: %s' % error, file=sys.stderr)
        return 1
    return 0


def _show(folder):
    try:
        from ros_3d_bb_annotator.main_window import run_window  # scripts need no Qt
    except ImportError as error:
        print('annotator: the window cannot be opened (%s); install PyQt5, or see annotator --help for commands that '
              'work without it' % error, file=sys.stderr)
        return 1
    return run_window(folder)


def _arguments(arguments):
    parser = argparse.ArgumentParser(prog='annotator', description=__doc__)
    parser.add_argument('session', nargs='?', metavar='SESSION', help='folder of a measurement session')
    actions = parser.add_mutually_exclusive_group()
    actions.add_argument('--export', metavar='FILE.csv', help='write a table with one row per annotated '
                         'person, in millimetres')
    actions.add_argument('--analyse', action='store_true', help='noise analysis: report, figures and error model')
    parser.add_argument('--out', metavar='DIR', help='output folder of --analyse (default: SESSION/analysis)')
    parser.add_argument('--estimator', choices=('foreground', 'median', 'recorded'), help='positions of --analyse and '
                        '--export: new estimates, or the recorded ones (default: foreground; --export has no median)')
    parsed = parser.parse_args(arguments)
    if (parsed.export or parsed.analyse) and not parsed.session:
        parser.error('a SESSION expected')
    if parsed.out and not parsed.analyse:
        parser.error('--out is for --analyse')
    if parsed.estimator and not (parsed.analyse or parsed.export and parsed.estimator != 'median'):
        parser.error('--estimator is for --analyse, and --export, which has no median')
    return parsed
