"""Command line of the benchmarks: `python3 -m ros_3d_bb_lab.evaluation NAME [OPTION ...]`, called by `./run bench`.

Errors that a benchmark raises are printed here.
"""
import importlib
import subprocess
import sys

MODULES = {'accuracy': 'accuracy', 'tracking': 'tracking.benchmark', 'prediction': 'tracking.motion_benchmark',
           'scenes': 'scene_benchmark', 'speed': 'speed', 'latency': 'latency.benchmark',
           'detector': 'detector_benchmark', 'costmap': 'costmap.benchmark', 'laser': 'costmap.laser_benchmark',
           'navigation': 'navigation.benchmark', 'gazebo': 'gazebo.benchmark'}


def main():
    """Run the benchmark named by the first argument."""
    name = sys.argv[1] if len(sys.argv) > 1 else ''
    if name not in MODULES:
        sys.stderr.write('./run bench: unknown benchmark %r; %s expected\n' % (name, ', '.join(sorted(MODULES))))
        return 2
    sys.argv = ['./run bench ' + name] + sys.argv[2:]
    try:
        return importlib.import_module('ros_3d_bb_lab.evaluation.' + MODULES[name]).main()
    except KeyboardInterrupt:
        return 130
    except (ValueError, OSError, RuntimeError, subprocess.SubprocessError) as error:
        sys.exit('%s: %s' % (sys.argv[0], error))


if __name__ == '__main__':
    sys.exit(main())
