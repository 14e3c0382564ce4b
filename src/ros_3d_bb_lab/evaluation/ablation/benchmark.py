"""Ablation: what the loss of each mechanism of estimation and tracking costs in the benchmarks, one at a time.

A mechanism is switched off by the replacement of one function, constant or parameter. Printed are the differences from
the results of all mechanisms; `=` if all digits are the same.
"""
import contextlib
import functools
import importlib
import sys
import types
from typing import Any, NamedTuple
from unittest import mock

import numpy as np

from ros_3d_bb.detection.network_detector import DetectionParams
from ros_3d_bb.estimation.box3d_estimator import estimator_named
from ros_3d_bb.estimation.error_model import read_error_model
from ros_3d_bb.sessions.session_reader import read_depth, read_session
from ros_3d_bb.tracking.tracker import Tracker
from ros_3d_bb_lab.evaluation import accuracy, scene_benchmark
from ros_3d_bb_lab.evaluation.ablation.views import scores_of_views, simulated_views
from ros_3d_bb_lab.evaluation.defaults import SIMULATED_ERROR_MODEL, data_folder, default_weights, scenario_path
from ros_3d_bb_lab.evaluation.detector_benchmark import open_networks
from ros_3d_bb_lab.evaluation.detectors import detector_of
from ros_3d_bb_lab.evaluation.text_table import lines_of
from ros_3d_bb_lab.evaluation.tracking.benchmark import outputs_of
from ros_3d_bb_lab.evaluation.tracking.metrics import score_run, scores_of
from ros_3d_bb_lab.evaluation.tracking.recorded_detections import read_recordings
from ros_3d_bb_lab.evaluation.tracking.robot_motion import DRIVING, STANDING
from ros_3d_bb_lab.evaluation.tracking.run_generator import simulate
from ros_3d_bb_lab.evaluation.tracking.trajectories import read_sequences
from ros_3d_bb_lab.evaluation.video import benchmark as video_benchmark
from ros_3d_bb_lab.evaluation.video.recording import read_truth, read_video
from ros_3d_bb_lab.simulation.scenario import read_scenario
from ros_3d_bb_lab.simulation.simulator import Simulator

ESTIMATION, TRACKING = 'estimation', 'tracking'
PACKAGE = 'ros_3d_bb'
SCENES = ('approach_child', 'approach_high_mount', 'approach_jackal', 'approach_tall', 'crowd_of_12', 'demo',
          'following_robot', 'objects')
SCENES_EVERY = 3
PEDESTRIANS_S, PEDESTRIANS_EVERY = 30, 3  # 10 Hz


class Mechanism(NamedTuple):
    """A mechanism, and what replaces the attribute, which may be that of a class, of a module of ros_3d_bb."""

    name: str
    module: str
    attribute: str
    replacement: Any


def _nothing(*_arguments):
    return None


MECHANISMS = tuple(Mechanism(*row) for row in (
    ('order of objects', 'estimation.overlaps', 'Overlaps._is_nearer', lambda *_: False),
    ('masks of nearer objects', 'estimation.overlaps', 'Overlaps.mask_behind', _nothing),
    ('outline of the rectangle', 'estimation.depth_samples', 'LEAST_INSIDE', 1.0),
    ('weights of samples', 'estimation.depth_samples', '_weights',
     lambda shape: np.full(shape[0] * shape[1], 1 / (shape[0] * shape[1]))),
    ('rows of the image', 'estimation.overlaps', 'CLEARLY_LOWER', 2.0),
    ('layers beside each other', 'estimation.overlaps', 'CLEARLY_FULLER', 2.0),
    ('second boxes', 'estimation.overlaps', 'CONTAINED', 2.0),
    ('nearest dominant layer', 'estimation.depth_samples', 'FIRST_LAYER_SHARE', 1.0),
    ('background that fills the sides', 'estimation.depth_samples', 'RectSamples.fill_sides', lambda *_: False),
    ('unknown depth in the middle', 'estimation.depth_samples', 'RectSamples.surround_unknown', lambda *_: False),
    ('least support', 'estimation.foreground', 'LEAST_SUPPORT', 0.0),
    ('least share of the samples', 'estimation.foreground', 'LEAST_SHARE', 0.0),
    ('level frame', 'estimation.box3d_estimator', 'STEEP', 2.0),
    ('wider rectangles of near people', 'estimation.body', '_widened', lambda seen, *_arguments: seen.rect_px),
    ('completion at the image border', 'estimation.body', 'Extent.completed', lambda extent, *_arguments: extent),
    ('border in proportion to the box', 'estimation.body', 'BORDER_SHARE', 0.0),
    ('uncertainty of little support', 'estimation.error_model', 'SUPPORT_SIGMAS_M', (0.0, 0.0, 0.0)),
    ('uncertainty at the image border', 'estimation.error_model', 'TRUNCATED_SIGMAS_M', (0.0, 0.0, 0.0)),
    ('manoeuvres', 'tracking.tracker', 'match_manoeuvres', lambda *_: []),
    ('duplicates of young tracks', 'tracking.tracker', 'duplicates', lambda *_: set()),
    ('no tracks beside recent ones', 'tracking.tracker', 'TrackerParams.duplicate_distance', 0.0),
    ('outliers', 'tracking.tracker', 'TrackerParams.outlier_share', 0.0),
    ('place that is occupied', 'tracking.occlusion', 'PRESENT_SHARE', 2.0),
    ('stops before the camera', 'tracking.occlusion', '_meets', lambda *_: False),
    ('blind range', 'tracking.occlusion', 'BLIND_M', 0.0),
    ('seen beside an occluder', 'tracking.occlusion', 'SEEN_BESIDE', 0.0),
    ('occlusion in depth', 'tracking.occlusion', 'HIDDEN_SHARE', 2.0),
    ('hidden sides', 'tracking.measurement_model', '_hidden_sides', lambda detections, _view: [0] * len(detections)),
    ('shift of partial boxes', 'tracking.measurement_model', 'PART_M', 0.0),
    ('uncertainty of truncated boxes', 'tracking.measurement_model', 'CUT_SIGMA_M', 0.0),
    ('learned noise', 'tracking.tracker', 'learned_log_scale', lambda scale, *_: scale),
    ('learned range', 'tracking.tracker', 'learned_range', lambda range_m, *_: range_m),
    ('correlated images', 'tracking.tracker', 'correlated_images', lambda *_: 1.0),
    ('heights', 'tracking.association', 'height_cost', lambda *_: 0.0),
    ('missed detections', 'tracking.tracker', 'detection_log_odds_of', lambda tracks, *_: [0.0] * len(tracks)),
    ('postures', 'tracking.association', 'POSTURE_COST', 1e9),
    ('outliers that follow each other', 'tracking.track', 'OUTLIER_CORRELATION_S', 1e-9),
    ('slow velocity', 'tracking.prediction', 'SLOW_SHARE', 0.0),
    ('manoeuvres in predictions', 'tracking.prediction', 'PredictionParams.manoeuvre_acceleration', 0.0),
    ('standing in predictions', 'tracking.prediction', 'PredictionParams.standing_speed', 0.0),
    ('scores of boxes', 'tracking.association', 'log_odds_of_arrival', lambda _probability: 0.0),
    ('correlated misses', 'tracking.track', 'MISS_CORRELATION_S', 1e-9)))


def check(mechanism):
    """The object that has the attribute of a Mechanism, and its name there. Raises ValueError if there is none."""
    owner = importlib.import_module('%s.%s' % (PACKAGE, mechanism.module))
    *path, name = mechanism.attribute.split('.')
    with contextlib.suppress(AttributeError):
        owner = functools.reduce(getattr, path, owner)
        getattr(owner, name)
        return owner, name
    raise ValueError('mechanism %r: %s.%s has no %s' % (mechanism.name, PACKAGE, mechanism.module, mechanism.attribute))


@contextlib.contextmanager
def without(mechanism):
    """Switch a Mechanism off, also in the modules that import its attribute. Raises ValueError if it does not exist."""
    owner, name = check(mechanism)
    original = getattr(owner, name)
    others = [module for key, module in sys.modules.items() if key.startswith(PACKAGE + '.') and module is not owner
              and vars(module).get(name) is original]
    with contextlib.ExitStack() as stack:
        for each in [owner] + others:
            stack.enter_context(mock.patch.object(each, name, mechanism.replacement))
        yield


def thesis_frames(_arguments):
    """Scores of the 3D boxes in the recorded frames, as of `./run bench accuracy`."""
    session = read_session(data_folder('thesis'))
    depths = [read_depth(frame, session) for frame in session.frames]

    @functools.lru_cache(maxsize=None)  # most mechanisms change no position
    def scores_of_positions(raw_m):
        result = accuracy.scores_of(accuracy.corrected(session, np.array(raw_m)), accuracy.truth_of(session),
                                    accuracy.are_truncated(session))
        return {key: result[key] for key in ('rmse_plane_m', 'p95_plane_m', 'coverage_95', 'missed')}

    def scores():
        raw_m = accuracy.raw_positions(session, depths, estimator_named('foreground'))
        return scores_of_positions(tuple(map(tuple, raw_m.tolist())))
    yield scores


def views(_arguments):
    """Scores of the 3D boxes in simulated views."""
    yield functools.partial(scores_of_views, list(simulated_views()))


def pedestrians(_arguments):
    runs = [simulate(sequence, motion, (0, 0), seconds=PEDESTRIANS_S)
            for sequence in read_sequences(data_folder('trajectories')) for motion in (STANDING, DRIVING)]
    yield functools.partial(_track_scores, [run._replace(images=run.images[::PEDESTRIANS_EVERY]) for run in runs])


def kitti(_arguments):
    yield functools.partial(_track_scores, list(read_recordings(data_folder('kitti'))))


def _track_scores(runs):
    scores = scores_of([score_run(run, outputs_of(Tracker(), run)) for run in runs])
    return {key: scores[key] for key in ('hota', 'idf1', 'id_switches', 'fde_2s_m')}


def scenes(_arguments):
    """Scores of tracks in each simulated scene, given its boxes."""
    model = read_error_model(SIMULATED_ERROR_MODEL)
    for name in SCENES:
        simulator = Simulator(read_scenario(scenario_path(name)))
        simulator.frame = functools.lru_cache(maxsize=None)(simulator.frame)

        def scores():
            exact = scene_benchmark.exact_detector(simulator)
            steps = scene_benchmark.run_scene(simulator, exact, SCENES_EVERY, error_model=model)
            result = scene_benchmark.result_of(steps, 'exact', simulator.camera)
            return {key: result[key] for key in ('rmse_m', 'velocity_rmse_mps', 'not_visible', 'id_switches')}
        yield scores


def videos(arguments):
    """Scores of tracks in each recorded video: YOLOv5n, or the detector without weights."""
    for name in ('corridor', 'lab'):
        folder = '%s/%s' % (data_folder('piv'), name)
        video = read_video(folder)
        pose, truth = video.camera_pose(), read_truth(video_benchmark.truth_path(folder), video)
        images = list(video.read())
        loaded = types.SimpleNamespace(camera=video.camera, read=functools.partial(iter, images))
        if arguments.weights:
            (network,) = open_networks([arguments.weights], DetectionParams().confidence).values()
            detected = [network.detect(color) for _name, color, _depth in images]
        else:
            detect, camera_from_floor = detector_of('depth', video.camera), np.linalg.inv(pose)
            detected = [detect(color, depth, camera_from_floor) for _name, color, depth in images]

        def scores():
            replayed = iter(detected)
            result = video_benchmark.score_detector(loaded, pose, truth, lambda *_image: next(replayed), truth.rate_hz)
            return {key: result[key] for key in ('idf1', 'hota', 'id_switches')}
        yield scores


# What is scored in each benchmark: a function yields functions that return the scores of a part of its data.
BENCHMARKS = {'thesis': (thesis_frames, (ESTIMATION,)), 'views': (views, (ESTIMATION,)),
              'pedestrians': (pedestrians, (TRACKING,)), 'kitti': (kitti, (TRACKING,)),
              'scenes': (scenes, (ESTIMATION, TRACKING)), 'video': (videos, (ESTIMATION, TRACKING))}


def ablate(parts, mechanisms):
    """{name: scores} of all `mechanisms` and without each. Of several parts, counts are added and others averaged."""
    rows = {mechanism.name: [] for mechanism in mechanisms}
    rows[''] = []
    for part in parts:
        rows[''].append(part())
        for mechanism in mechanisms:
            with without(mechanism):
                rows[mechanism.name].append(part())
    return {name: {key: sum(values) if isinstance(values[0], int) else float(np.mean(values))
                   for key, values in ((key, [scores[key] for scores in each]) for key in each[0])}
            for name, each in rows.items()}


def run(arguments):
    """Print the scores of each benchmark, and their differences without each mechanism."""
    if not data_folder('thesis'):
        raise ValueError('the recorded data is missing; ROS_3D_BB_DATA must name its folder')
    chosen = [each for each in MECHANISMS if any(word in each.name + each.module for word in arguments.mechanisms)]
    result = {}
    for benchmark in arguments.benchmarks:
        function, packages = BENCHMARKS[benchmark]
        concerned = [each for each in chosen if each.module.split('.')[0] in packages]
        if concerned:
            result[benchmark] = ablate(function(arguments), concerned)
            print('\n'.join([''] + _table_of(benchmark, result[benchmark])), flush=True)
    return result


def _table_of(benchmark, rows):
    base = rows['']
    texts = [['without ' + name] + ['=' if row[key] == base[key] else '%+.4g' % (row[key] - base[key]) for key in base]
             for name, row in rows.items() if name]
    return lines_of([benchmark] + list(base), [['all'] + ['%.4g' % value for value in base.values()]] + texts)


def add_options(parser):
    parser.add_argument('mechanisms', nargs='*', default=[''], metavar='WORD',
                        help='a part of the names of mechanisms, or of their modules (default: all)')
    parser.add_argument('--benchmarks', nargs='+', choices=tuple(BENCHMARKS), default=tuple(BENCHMARKS),
                        help='default: all')
    parser.add_argument('--weights', default=default_weights(), metavar='FILE',
                        help='YOLOv5 checkpoint for the videos; without it, they are processed by the detector '
                        'without weights')
