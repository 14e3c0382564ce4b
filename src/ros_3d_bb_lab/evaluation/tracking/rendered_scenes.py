"""Comparison of trackers with the complete pipeline, on the rendered scenes of the simulation."""
import os

from ros_3d_bb_lab.evaluation.scene_benchmark import depth_detector, result_of, yolov5_detector
from ros_3d_bb_lab.evaluation.scenes import look_at_scene, track_scene
from ros_3d_bb_lab.evaluation.tracking.benchmark import CONTESTANTS
from ros_3d_bb_lab.simulation.scenario import read_scenario
from ros_3d_bb_lab.simulation.simulator import Simulator

TRACKERS = [contestant for contestant in CONTESTANTS if contestant.name != 'thesis']
COLUMNS = '%-22s %-8s %7s %9s %9s %9s'


def compare_scenes(paths, weights=None, every=2):
    """Run scenes with each tracker on every n-th image and print the scores.

    Parameters
    ----------
    paths : list of str
        Scenario files.
    weights : str, optional
        Checkpoint or export of YOLOv5. Without it, people are detected by the weight-free detector.
    every : int
        Use every n-th image.

    Returns
    -------
    list of dict
        As in `./run bench scenes`, with the name of the tracker as `tracker`.

    Raises
    ------
    ValueError, OSError
        If a scenario or the weights cannot be used.
    """
    yolov5 = yolov5_detector(weights) if weights else None
    print(COLUMNS % ('scene', 'tracker', 'images', 'switches', 'RMSE', 'worst'))
    results = []
    for path in paths:
        name, simulator = os.path.splitext(os.path.basename(path))[0], Simulator(read_scenario(path))
        images = look_at_scene(simulator, yolov5 or depth_detector(simulator), every)
        steps = track_scene(images, [contestant.make() for contestant in TRACKERS])
        for contestant, own_steps in zip(TRACKERS, steps):
            result = result_of(own_steps, 'yolov5' if weights else 'depth')
            lengths = ['-' if result[key] is None else '%.3f m' % result[key] for key in ('rmse_m', 'worst_m')]
            print(COLUMNS % ((name, contestant.name, result['images'], result['id_switches']) + tuple(lengths)),
                  flush=True)
            results.append(dict(result, scene=name, tracker=contestant.name))
    return results
