"""Compare trackers on simulated detections from a camera on a standing or driving robot among recorded pedestrians.

Detection errors are as measured in the thesis. Without recordings, pedestrian trajectories are generated.
"""
import argparse
import json
import os
import sys

from ros_3d_bb_lab.evaluation.defaults import scenario_path
from ros_3d_bb_lab.evaluation.scene_benchmark import depth_detector, result_of, yolov5_detector
from ros_3d_bb_lab.evaluation.scenes import detect_in_scene, track_scene
from ros_3d_bb_lab.evaluation.tracking.benchmark import BOUND, CONTESTANTS, PEOPLE, compare, cpu_ms, runs_of, table
from ros_3d_bb_lab.evaluation.tracking.run_generator import SECONDS
from ros_3d_bb_lab.evaluation.tracking.trajectories import COLUMNS, made_sequences, read_sequences
from ros_3d_bb_lab.simulation.scenario import read_scenario
from ros_3d_bb_lab.simulation.simulator import Simulator

SCENE_COLUMNS = '%-22s %-13s %7s %9s %9s %9s'
SCENE_EVERY = 2  # every n-th image of a scene is used


def main():
    """Run the command `./run bench tracking`."""
    arguments = _arguments()
    try:
        if arguments.scenarios:
            result = {'scenes': bench_scenes(arguments.scenarios, arguments.weights)}
        else:
            result = bench(arguments)
        if arguments.json:
            with open(arguments.json, 'w') as stream:
                json.dump(result, stream, indent=1)
    except (ValueError, OSError) as error:
        sys.exit('./run bench tracking: %s' % error)


def bench(arguments):
    """Run the comparison and print it. Returns the settings and the scores of each tracker, as written by --json."""
    sequences = read_sequences(arguments.data) if arguments.data else made_sequences(arguments.seed)
    names = [sequence.name for sequence in sequences]
    print('sequences: %s (%s), seed %d' % (', '.join(names), arguments.data or 'generated; no recordings found',
                                           arguments.seed), flush=True)
    contestants = CONTESTANTS + ((BOUND,) if arguments.bound else ())
    runs = runs_of(sequences, arguments.seed, arguments.repetitions, arguments.seconds)
    trackers = compare(runs, contestants)
    for contestant in contestants:
        trackers[contestant.name]['cpu_ms'] = {str(people): cpu_ms(contestant.make, people) for people in PEOPLE}
    print('\n'.join(table(trackers)))
    return {'sequences': names, 'recorded': bool(arguments.data), 'seed': arguments.seed,
            'repetitions': arguments.repetitions, 'seconds': arguments.seconds, 'trackers': trackers}


def bench_scenes(paths, weights):
    """Run the complete pipeline on rendered scenes with each tracker and print the scores.

    People are detected by YOLOv5 with `weights`, or by the weight-free detector. Returns the results of
    `./run bench scenes`, with the name of the tracker as `tracker`.
    """
    yolov5, results = yolov5_detector(weights) if weights else None, []
    print(SCENE_COLUMNS % ('scene', 'tracker', 'images', 'switches', 'RMSE', 'worst'))
    contestants = [contestant for contestant in CONTESTANTS if contestant.name != 'thesis']
    for path in paths:
        name, simulator = os.path.splitext(os.path.basename(path))[0], Simulator(read_scenario(path))
        images = detect_in_scene(simulator, yolov5 or depth_detector(simulator), SCENE_EVERY)
        steps = track_scene(images, [contestant.make() for contestant in contestants])
        for contestant, own_steps in zip(contestants, steps):
            result = result_of(own_steps, 'yolov5' if weights else 'depth')
            rmse, worst = ('-' if result[key] is None else '%.3f m' % result[key] for key in ('rmse_m', 'worst_m'))
            print(SCENE_COLUMNS % (name, contestant.name, result['images'], result['id_switches'], rmse, worst),
                  flush=True)
            results.append(dict(result, scene=name, tracker=contestant.name))
    return results


def _arguments():
    parser = argparse.ArgumentParser(prog='./run bench tracking', description=__doc__)
    data = os.path.join(os.environ.get('ROS_3D_BB_DATA', ''), 'data', 'trajectories')
    parser.add_argument('--data', default=data if os.path.isdir(data) else None, metavar='DIR',
                        help='folder of CSV files with the columns %s (default: $ROS_3D_BB_DATA/data/trajectories if '
                        'it exists, otherwise generated trajectories)' % ','.join(COLUMNS))
    parser.add_argument('--seed', type=int, default=0, metavar='N', help='random seed (default: 0)')
    parser.add_argument('--repetitions', type=int, default=2, metavar='N',
                        help='runs of each sequence with a standing and with a driving robot (default: 2)')
    parser.add_argument('--seconds', type=float, default=SECONDS, help='duration of a run (default: %g)' % SECONDS)
    parser.add_argument('--bound', action='store_true', help='also score our tracker with perfect data association')
    parser.add_argument('--scenarios', nargs='+', type=scenario_path, metavar='SCENARIO',
                        help='run the complete pipeline on rendered scenes instead')
    parser.add_argument('--weights', help='YOLOv5 checkpoint for --scenarios (default: weight-free detector)')
    parser.add_argument('--json', metavar='FILE', help='also write the scores to FILE')
    arguments = parser.parse_args()
    for name in ('repetitions', 'seconds'):
        if not getattr(arguments, name) > 0:
            parser.error('--%s is %g; more than 0 expected' % (name, getattr(arguments, name)))
    if arguments.weights and not arguments.scenarios:
        parser.error('--weights requires --scenarios; people in recordings are not rendered')
    if not 0 <= arguments.seed < 2 ** 32:
        parser.error('--seed is %d; 0 to %d expected' % (arguments.seed, 2 ** 32 - 1))
    return arguments


if __name__ == '__main__':
    main()
