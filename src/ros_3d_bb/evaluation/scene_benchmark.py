"""The pipeline on simulated scenes with each detector, against the truth: a table."""
import argparse
import json
import os
import sys

import numpy as np

from ros_3d_bb.detection.depth_people import DepthPeople
from ros_3d_bb.detection.floor import floor_from_transform
from ros_3d_bb.estimation import DepthImage
from ros_3d_bb.evaluation.identities import score
from ros_3d_bb.evaluation.scenes import run_scene, score_detections
from ros_3d_bb.simulation.scenario import ScenarioError, read_scenario
from ros_3d_bb.simulation.simulator import Simulator

RANGE_M = {'yolov5': (2.0, 8.0), 'depth': (2.0, 6.0)}  # in which a detector has to find people
COLUMNS = '%-22s %-7s %7s %7s %8s %9s %8s %8s'


def depth_detector(simulator):
    """The weight-free detector for `run_scene`, which is told the floor as tf would tell it."""
    detector = DepthPeople()
    return lambda frame: detector.detect(frame.color, DepthImage(frame.depth_mm, 0.001), simulator.camera,
                                         floor_from_transform(np.linalg.inv(frame.poses.map_from_camera))).boxes


def yolov5_detector(weights):
    """YOLOv5 for `run_scene`, of a checkpoint. Raises ValueError where it cannot be used."""
    from ros_3d_bb.detection.runtime import RuntimeParams, open_runtime  # may import torch, which takes seconds
    from ros_3d_bb.detection.yolov5 import Yolov5
    detector = Yolov5(open_runtime(weights, RuntimeParams(device='cpu')))
    return lambda frame: detector.detect(frame.color).boxes


def result_of(steps, detector):
    """The scores of a run as a dictionary, see `./run bench scenes`; `detector` yolov5 or depth.

    Lengths in metres, shares 0..1; errors are those of all people in the scene together.
    """
    found, tracked = score_detections(steps, *RANGE_M[detector]), score([step.moment for step in steps])
    followed = [person for person in tracked.people if person.ids]
    return {'detector': detector, 'images': found.images, 'people': len(tracked.people), 'recall': found.recall,
            'false_boxes': found.false_rate, 'id_switches': sum(person.switches for person in tracked.people),
            'rmse_m': float(np.sqrt(np.mean([person.rmse_m ** 2 for person in followed]))) if followed else None,
            'worst_m': max([person.worst_m for person in followed], default=None)}


def main():
    """The command `./run bench scenes`."""
    parser = argparse.ArgumentParser(prog='./run bench scenes', description=__doc__)
    parser.add_argument('scenarios', nargs='+', help='scenario files')
    parser.add_argument('--weights', help='checkpoint or export of YOLOv5; without it, the weight-free detector only')
    parser.add_argument('--every', type=int, default=2, metavar='N', help='use one image of N (default: 2)')
    parser.add_argument('--json', metavar='FILE', help='also write the scores there')
    arguments = parser.parse_args()
    results = []
    try:
        yolov5 = yolov5_detector(arguments.weights) if arguments.weights else None
        print(COLUMNS % ('scene', 'detector', 'images', 'recall', 'false', 'switches', 'RMSE', 'worst'))
        for path in arguments.scenarios:
            results += _run(path, yolov5, arguments.every)
        if arguments.json:
            with open(arguments.json, 'w') as stream:
                json.dump({'scenes': results}, stream, indent=1)
    except (ScenarioError, ValueError, OSError) as error:
        sys.exit('./run bench scenes: %s' % error)


def _run(path, yolov5, every):
    """Run and print one scene with each detector."""
    name, simulator, results = os.path.basename(path).replace('.yaml', ''), Simulator(read_scenario(path)), []
    for detector, detect in (('depth', depth_detector(simulator)), ('yolov5', yolov5)):
        if detect is not None:
            result = dict(result_of(run_scene(simulator, detect, every), detector), scene=name)
            lengths = ['%.3f m' % result[key] if result[key] is not None else '-' for key in ('rmse_m', 'worst_m')]
            print(COLUMNS % (name, detector, result['images'], '%.3f' % result['recall'],
                             '%.3f' % result['false_boxes'], result['id_switches'], lengths[0], lengths[1]), flush=True)
            results.append(result)
    return results


if __name__ == '__main__':
    main()
