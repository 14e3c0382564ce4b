"""Benchmark of the pipeline on simulated scenes with different detectors, against ground truth."""
import argparse
import json
import os
import sys

import numpy as np

from ros_3d_bb.camera.depth_image import DepthImage
from ros_3d_bb.detection.depth.detector import DepthPeople
from ros_3d_bb.detection.depth.ground_plane import floor_from_transform
from ros_3d_bb.estimation.error_model import read_error_model
from ros_3d_bb_lab.evaluation.clear_mot import score
from ros_3d_bb_lab.evaluation.defaults import SIMULATED_ERROR_MODEL, scenario_path, scenario_paths
from ros_3d_bb_lab.evaluation.scene_tracks import is_in_image, score_tracks
from ros_3d_bb_lab.evaluation.scenes import LEAST_SHOWN, run_scene, score_detections
from ros_3d_bb_lab.simulation.scenario import read_scenario
from ros_3d_bb_lab.simulation.simulator import D435I_COLOR, Simulator

RANGE_M = {'yolov5': (2.0, 8.0), 'depth': (2.0, 6.0), 'exact': (0.5, 8.0)}  # evaluated range of each detector
EVERY = {'yolov5': 2, 'depth': 2, 'exact': 1}  # every n-th image is used
JITTER_PX = 1.0  # standard deviation of the box edges of the `exact` detector
COLUMNS = '%-20s %-8s %6s %6s %6s %8s %7s %7s %4s %11s %9s %9s'
HEADINGS = ('scene', 'detector', 'images', 'recall', 'false', 'switches', 'RMSE', 'worst', 'IDs', 'not visible',
            'velocity', '1 s ahead')


def depth_detector(simulator):
    """Weight-free detector for `run_scene`. It receives the floor plane that tf provides on a robot."""
    detector = DepthPeople()
    return lambda frame: detector.detect(frame.color, DepthImage(frame.depth_mm, 0.001), simulator.camera,
                                         floor_from_transform(np.linalg.inv(frame.poses.map_from_camera))).boxes


def yolov5_detector(weights):
    """YOLOv5 detector for `run_scene` from a checkpoint. Raises ValueError if the checkpoint cannot be used."""
    from ros_3d_bb.detection.yolov5.backends import RuntimeParams, open_runtime  # may import torch (slow)
    from ros_3d_bb.detection.yolov5.detector import Yolov5
    detector = Yolov5(open_runtime(weights, RuntimeParams(device='cpu')))
    return lambda frame: detector.detect(frame.color).boxes


def exact_detector(simulator):
    """Detector for `run_scene` that returns the true boxes, with edges jittered by `JITTER_PX`.

    People that are mostly occluded or outside the image are left out. A person is returned if
    `scene_tracks.is_in_image` holds, or if at least `LEAST_SHOWN` of the body is visible.
    """
    seed, camera = simulator.scenario.seed, simulator.camera

    def detect(frame):
        random = np.random.RandomState([seed, frame.number])
        jitter_px = np.rint(random.normal(0, JITTER_PX, (len(frame.people), 4)))
        shown = [person.visible >= LEAST_SHOWN or is_in_image(person, frame.poses.map_from_camera, camera)
                 for person in frame.people]
        boxes = [person.box_px + jitter for person, jitter, is_shown in zip(frame.people, jitter_px, shown) if is_shown]
        return np.clip(np.reshape(boxes, (-1, 4)), 0, [camera.width, camera.height] * 2)

    return detect


def result_of(steps, detector, camera=D435I_COLOR):
    """Scores of a run as a dictionary, as `./run bench scenes` writes them. `detector` is yolov5, depth or exact.

    Lengths are in metres and shares are 0..1. Errors are aggregated over all people in the scene.
    """
    found, tracked = score_detections(steps, *RANGE_M[detector]), score([step.moment for step in steps])
    followed = [person for person in tracked.people if person.ids]
    result = {'detector': detector, 'images': found.images, 'people': len(tracked.people), 'recall': found.recall,
              'false_boxes': found.false_rate, 'id_switches': sum(person.switches for person in tracked.people),
              'rmse_m': float(np.sqrt(np.mean([person.rmse_m ** 2 for person in followed]))) if followed else None,
              'worst_m': max([person.worst_m for person in followed], default=None)}
    result.update(score_tracks(steps, camera)._asdict())
    return result


def main():
    """Run the command `./run bench scenes`."""
    arguments = _parser().parse_args()
    results = []
    try:
        yolov5 = yolov5_detector(arguments.weights) if arguments.weights else None
        error_model = read_error_model(arguments.error_model) if arguments.error_model else None
        print(COLUMNS % HEADINGS)
        for path in arguments.scenarios:
            results += _run(path, yolov5, error_model, arguments.every)
        if arguments.json:
            with open(arguments.json, 'w') as stream:
                json.dump({'scenes': results}, stream, indent=1)
    except (ValueError, OSError) as error:
        sys.exit('./run bench scenes: %s' % error)


def _parser():
    parser = argparse.ArgumentParser(prog='./run bench scenes', description=__doc__)
    parser.add_argument('scenarios', nargs='*', type=scenario_path, metavar='SCENARIO',
                        default=scenario_paths('thesis_*', 'approach_*'),
                        help='names in config/scenarios or files (default: thesis_*, approach_*)')
    parser.add_argument('--weights', help='checkpoint or export of YOLOv5; without it, it is left out')
    parser.add_argument('--error-model', default=SIMULATED_ERROR_MODEL, metavar='FILE',
                        help='error model for the boxes of the detector `exact` (default: that of simulation.launch)')
    parser.add_argument('--every', type=int, metavar='N',
                        help='use one image of N (default: %s)' % ', '.join('%s %d' % item for item in EVERY.items()))
    parser.add_argument('--json', metavar='FILE', help='also write the scores there')
    return parser


def _run(path, yolov5, error_model, every):
    """Run one scene with each detector and print the results. The error model applies only to the boxes of `exact`."""
    name, simulator, results = os.path.basename(path).replace('.yaml', ''), Simulator(read_scenario(path)), []
    every = EVERY if every is None else dict.fromkeys(EVERY, every)
    for detector, detect, model in (('depth', depth_detector(simulator), None), ('yolov5', yolov5, None),
                                    ('exact', exact_detector(simulator), error_model)):
        if detect is not None:
            steps = run_scene(simulator, detect, every[detector], error_model=model)
            results.append(dict(result_of(steps, detector, simulator.camera), scene=name))
            print(COLUMNS % _row(results[-1]), flush=True)
    return results


def _row(result):
    """Values of a result as printed in the table."""
    texts = [result['scene'], result['detector'], result['images'], '%.3f' % result['recall'],
             '%.3f' % result['false_boxes'], result['id_switches']]
    texts += [_text(result[key], 'm') for key in ('rmse_m', 'worst_m')] + [result['track_ids'], result['not_visible']]
    return tuple(texts + [_text(result['velocity_rmse_mps'], 'm/s'), _text(result['prediction_1s_m'], 'm')])


def _text(value, unit):
    return '-' if value is None else '%.3f %s' % (value, unit)


if __name__ == '__main__':
    main()
