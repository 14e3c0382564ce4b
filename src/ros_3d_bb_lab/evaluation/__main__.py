"""Command line of the benchmarks: `python3 -m ros_3d_bb_lab.evaluation NAME [OPTION ...]`, called by `./run bench`.

A benchmark is a module with `add_options(parser)` and `run(arguments)`, which prints and returns its result, a
dictionary. Errors that it raises are printed here.
"""
import argparse
import importlib
import json
import subprocess
import sys

from ros_3d_bb.core.atomic_file import check_writable, clean_up_on_sigterm

MODULES = {'ablation': 'ablation.benchmark', 'accuracy': 'accuracy', 'tracking': 'tracking.benchmark',
           'prediction': 'tracking.prediction_benchmark', 'scenes': 'scene_benchmark', 'speed': 'speed',
           'latency': 'latency.benchmark', 'detector': 'detector_benchmark', 'navigation': 'navigation.benchmark',
           'gazebo': 'gazebo.benchmark', 'video': 'video.benchmark'}


def main(words):
    """Run the benchmark named by the first word, with the others as its options."""
    name = words[0] if words else ''
    if name not in MODULES:
        sys.stderr.write('./run bench: unknown benchmark %r; %s expected\n' % (name, ', '.join(sorted(MODULES))))
        return 2
    module = importlib.import_module('ros_3d_bb_lab.evaluation.' + MODULES[name])
    parser = argparse.ArgumentParser(prog='./run bench ' + name, description=module.__doc__)
    module.add_options(parser)
    parser.add_argument('--json', metavar='FILE', help='also write the result to FILE')
    arguments = parser.parse_args(words[1:])
    clean_up_on_sigterm()  # ends all processes
    try:
        if arguments.json:
            check_writable(arguments.json)
        result = module.run(arguments)
        if arguments.json:
            with open(arguments.json, 'w') as stream:
                json.dump(dict(result, command='./run bench ' + ' '.join(words)), stream, indent=1)
    except KeyboardInterrupt:
        return 130
    except (ValueError, OSError, RuntimeError, subprocess.SubprocessError) as error:
        sys.exit('%s: %s' % (parser.prog, error))


if __name__ == '__main__':
    sys.exit(main(sys.argv[1:]))
