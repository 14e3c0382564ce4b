"""The command `./run soak`: the whole graph for half an hour, with random faults; prints tables of the results."""
import argparse
import json
import os
import signal
import sys
import tempfile

from ros_3d_bb_lab.evaluation.launching import free_port

SCENARIOS = os.path.join(os.path.dirname(os.path.abspath(__file__)), '..', '..', 'config', 'scenarios')
SCENES = ('demo', 'thesis_e_passing', 'behind_a_pillar', 'empty_room')


def main():
    """Return the exit status: 1 if an invariant is violated, 130 after Ctrl-C."""
    arguments = _arguments()
    port = free_port()
    os.environ['ROS_MASTER_URI'] = 'http://localhost:%d' % port  # before rospy reads it
    from soak.graph import GraphEnded
    from soak.report import report
    from soak.rig import soak
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # runs the cleanup, which ends all processes
    try:
        with tempfile.TemporaryDirectory() as folder:
            record, interrupted = soak(arguments, port, folder)
    except KeyboardInterrupt:
        sys.exit(130)
    except (GraphEnded, ValueError, OSError) as error:
        sys.exit('./run soak: %s' % error)

    result = report(record, arguments)
    if arguments.json:
        with open(arguments.json, 'w') as stream:
            json.dump(result, stream, indent=1)
    if not all(invariant['holds'] for invariant in result['invariants']):
        return 1
    return 130 if interrupted else 0


def _arguments():
    parser = argparse.ArgumentParser(prog='./run soak', description=__doc__)
    parser.add_argument('--minutes', type=float, default=30.0, help='default: 30')
    parser.add_argument('--seed', type=int, default=1, help='seed of the faults and their order (default: 1)')
    parser.add_argument('--rate', type=float, default=10.0, metavar='HZ', help='images per second (default: 10)')
    parser.add_argument('--detector', choices=('depth', 'yolov5', 'none'), default='depth',
                        help='none: the true 2D boxes of the scenes (default: depth; yolov5 with --weights)')
    parser.add_argument('--weights', help='checkpoint or export of YOLOv5')
    parser.add_argument('--images', type=int, default=30, metavar='N', help='images of each scene (default: 30)')
    parser.add_argument('--scenarios', nargs='+', metavar='FILE', help='default: %s' % ', '.join(SCENES),
                        default=[os.path.join(SCENARIOS, name + '.yaml') for name in SCENES])
    parser.add_argument('--recover-within', type=float, default=2.0, metavar='S',
                        help="limit from the end of a fault's cause to an answer (default: 2)")
    parser.add_argument('--json', metavar='FILE', help='also write the results to this file')
    arguments = parser.parse_args()
    if not (arguments.minutes > 0 and 0 < arguments.rate <= 100 and arguments.images > 1):
        parser.error('--minutes %g, --rate %g, --images %d: more than 0 expected, at most 100 Hz, at least 2 images'
                     % (arguments.minutes, arguments.rate, arguments.images))
    if arguments.weights:
        arguments.weights, arguments.detector = os.path.abspath(arguments.weights), 'yolov5'
    elif arguments.detector == 'yolov5':
        parser.error('--detector yolov5 needs --weights')
    return arguments


if __name__ == '__main__':
    sys.exit(main())
