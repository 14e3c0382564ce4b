"""Benchmark of the pipeline on simulated scenes with different detectors, against ground truth, without ROS."""
import functools
from typing import NamedTuple

import numpy as np

from ros_3d_bb.camera.camera_model import transform_points
from ros_3d_bb.camera.images import DepthImage
from ros_3d_bb.core.object_classes import PERSON
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.detection.boxes import Detections, iou
from ros_3d_bb.estimation.appearance import appearance_of
from ros_3d_bb.estimation.box3d import plausible
from ros_3d_bb.estimation.box3d_estimator import estimate_boxes, estimator_named, level_rotation
from ros_3d_bb.estimation.error_model import corrected_boxes, read_error_model
from ros_3d_bb.pipeline.detectors import without_weights
from ros_3d_bb.tracking.occlusion import depths_towards
from ros_3d_bb.tracking.tracker import Tracker
from ros_3d_bb.tracking.types import VISIBLE, CameraView, detections_from_boxes
from ros_3d_bb_lab.evaluation.clear_mot import ClearMatcher, Moment, distance_m, score
from ros_3d_bb_lab.evaluation.defaults import SIMULATED_ERROR_MODEL, add_scenarios, scene_name
from ros_3d_bb_lab.evaluation.detectors import detector_of
from ros_3d_bb_lab.evaluation.matching import plane_distances
from ros_3d_bb_lab.evaluation.text_table import line_of
from ros_3d_bb_lab.simulation.scenario import read_scenario
from ros_3d_bb_lab.simulation.simulator import D435I_COLOR, SimulatedFrame, Simulator, is_in_image, jittered_boxes

FOUND_IOU = 0.5  # minimum IoU of a true positive
RANGE_M = {'yolov5': (2.0, 8.0), 'depth': (2.0, 6.0), 'exact': (0.5, 8.0)}  # evaluated range of each detector
EVERY = 2  # every n-th image is used, but each one with exact boxes
NEAREST_M = 0.5  # minimum distance from the camera in the plane
HELD_M = 0.5  # maximum distance between a person and a matching track
ROUNDING_M = 1e-6


class Step(NamedTuple):
    """One image: its frame without pixels, the detected 2D boxes (n, 4), and the truth and tracks after it."""

    frame: SimulatedFrame
    boxes: np.ndarray
    moment: Moment


def run_scene(simulator, detect, every=1, error_model=None):
    """Run the pipeline on every `every`-th image of a scene. Returns a list of Step.

    `detect` is called with a SimulatedFrame and returns `boxes.Detections`. An error model corrects the 3D boxes and
    provides their covariance, as in bbox3d_node.
    """
    tracker, steps = Tracker(), []
    for number in range(0, simulator.frame_count, every):
        frame = simulator.frame(number)
        detected = detect(frame)
        stamp_ns = int(round(frame.time_s * NS))
        people = [track for track in simulator.true_tracks(frame, stamp_ns) if track.label == PERSON]
        tracks = track_frame(tracker, frame, detected, stamp_ns, simulator.camera, error_model)
        steps.append(Step(frame._replace(color=None, depth_mm=None), detected.boxes, Moment(stamp_ns, people, tracks)))
    return steps


def track_frame(tracker, frame, detected, stamp_ns, camera, error_model):
    """Update a Tracker with the 2D detections in a SimulatedFrame, as bbox3d_node and tracker_node do. Returns the
    tracks.
    """
    depth, map_from_camera = DepthImage(frame.depth_mm, 0.001), frame.poses.map_from_camera
    found = boxes3d_of(detected, frame.color, depth, camera, map_from_camera, error_model)
    return tracker.update(stamp_ns, detections_from_boxes(dict(enumerate(found)), map_from_camera),
                          view_of(depth, camera, map_from_camera, frame.camera_name))


def boxes3d_of(detected, color, depth, camera, fixed_from_camera, error_model=None):
    """The list of plausible `box3d.Box3D` of the Detections in an image, as of bbox3d_node."""
    rects_px = np.rint(detected.boxes).astype(int)
    usable = (rects_px[:, :2] < rects_px[:, 2:]).all(axis=1)
    estimated = estimate_boxes(depth, list(map(tuple, rects_px[usable].tolist())), camera,
                               estimator_named('foreground'),
                               level_from_camera=level_rotation(fixed_from_camera[2, :3]))
    boxes = [box._replace(score=score, appearance=appearance_of(box, color, depth, camera))
             for box, score in zip(estimated, detected.scores[usable]) if plausible(box)]
    return corrected_boxes(boxes, error_model)


def view_of(depth, camera, fixed_from_camera, name):
    return CameraView(fixed_from_camera, camera, name, functools.partial(depths_towards, camera, depth))


def detector_in(simulator, name):
    """Detector without weights for `run_scene`. It receives the floor plane that tf provides on a robot."""
    detect = detector_of(name, simulator.camera)
    return lambda frame: detect(frame.color, DepthImage(frame.depth_mm, 0.001),
                                np.linalg.inv(frame.poses.map_from_camera))


def yolov5_detector(weights):
    """YOLOv5 detector for `run_scene` from a checkpoint. Raises ValueError if the checkpoint cannot be used."""
    from ros_3d_bb.detection.yolov5.backends import RuntimeParams, open_detector  # may import torch (slow)
    detector = open_detector(weights, running=RuntimeParams(device='cpu'))
    return lambda frame: detector.detect(frame.color)


def exact_detector(simulator):
    return lambda frame: detections_without_scores(jittered_boxes(frame, simulator.camera, simulator.scenario.seed))


def detections_without_scores(boxes):
    return Detections(np.array(boxes, float).reshape(-1, 4), np.zeros(len(boxes)), np.zeros(len(boxes), int))


def score_detections(steps, nearest_m, farthest_m, least_visible=0.8):
    """Count true and false detections of sufficiently visible people in a range of depth.

    In each image, boxes and people are matched one to one in order of decreasing IoU. Returns the numbers of people to
    be detected, of people found, and of false boxes.
    """
    people = found = false = 0
    for step in steps:
        shown = [person for person in step.frame.people if person.box_px is not None]
        overlaps = np.array([iou(box, np.array([person.box_px for person in shown])) for box in step.boxes])
        overlaps = overlaps.reshape(len(step.boxes), len(shown))
        pairs = [pair for pair in _matched_greedily(-overlaps) if overlaps[pair] >= FOUND_IOU]
        false += len(step.boxes) - len(pairs)
        found_people = set(column for _row, column in pairs)
        camera_from_map = np.linalg.inv(step.frame.poses.map_from_camera)
        for column, person in enumerate(shown):
            depth_m = transform_points(camera_from_map, person.position_m)[2]
            if person.visible >= least_visible and nearest_m <= depth_m <= farthest_m:
                people += 1
                found += column in found_people
    return people, found, false


def _matched_greedily(distances):
    """Pair rows with columns of `distances` (n, m) greedily. Each row and column is used at most once.

    Returns a list of min(n, m) pairs (row, column) by increasing distance; ties are ordered by row, then column.
    """
    distances = np.asarray(distances, float)
    pairs, rows, columns = [], set(), set()
    for row, column in zip(*np.unravel_index(np.argsort(distances, axis=None, kind='mergesort'), distances.shape)):
        if row not in rows and column not in columns:
            pairs.append((int(row), int(column)))
            rows.add(row)
            columns.add(column)
    return pairs


def score_tracks(images, horizons_s=(1.0,)):
    """Compare the VISIBLE tracks of a scene with people.

    `images` is a list of (people, tracks), both lists of TrackedObject. `track_ids` is the number of IDs of VISIBLE
    tracks near people; `not_visible` counts, summed over people, the images after the first match in which a person has
    no VISIBLE track; the RMS errors of the velocity and of the positions predicted for each of `horizons_s` are in the
    plane, None if no track was matched.
    """
    track_ids, not_visible, velocity_errors, prediction_errors = set(), 0, [], {time_s: [] for time_s in horizons_s}
    followed, matcher = set(), ClearMatcher(HELD_M)
    for people, all_tracks in images:
        tracks = [track for track in all_tracks if track.status == VISIBLE]
        near_m = plane_distances([person.position_m for person in people] or np.zeros((0, 3)),
                                 [track.position_m for track in tracks] or np.zeros((0, 3))) <= HELD_M
        track_ids.update(track.id for track, near in zip(tracks, near_m.T) if near.any())
        not_visible += sum(person.id in followed and not near.any() for person, near in zip(people, near_m))
        for person, track in matcher.match(people, tracks):
            followed.add(person.id)
            velocity_errors.append(distance_m(track.velocity_mps, person.velocity_mps))
            for time_s, errors in prediction_errors.items():
                predicted_m, true_m = _predicted_m(track, time_s), _predicted_m(person, time_s)
                if predicted_m is not None and true_m is not None:
                    errors.append(distance_m(predicted_m, true_m))
    scores = {'track_ids': len(track_ids), 'not_visible': not_visible, 'velocity_rmse_mps': _rms(velocity_errors)}
    scores.update({'prediction_%gs_m' % time_s: _rms(errors) for time_s, errors in prediction_errors.items()})
    return scores


def scored_people(step, camera):
    """Return the people whose body axis is in the image, at `NEAREST_M` or more from the camera.

    `clear_mot` scores people of whose body an image shows a minimum share. A person directly in front of the camera
    fills the image and shows less than that, but is the most important one for a robot.
    """
    map_from_camera = step.frame.poses.map_from_camera
    shown = set(person.id for person in step.frame.people if is_in_image(person, map_from_camera, camera)
                and distance_m(person.position_m, map_from_camera[:3, 3]) >= NEAREST_M - ROUNDING_M)
    return [person for person in step.moment.truth if person.id in shown]


def _predicted_m(track, time_s):
    """Predicted position (3,) of a track after a time; None if the prediction is shorter."""
    number = int(round(time_s / track.prediction_step_s)) - 1 if len(track.prediction_m) else 0
    return track.prediction_m[number] if number < len(track.prediction_m) else None


def _rms(errors):
    return float(np.sqrt(np.mean(np.square(errors)))) if errors else None


def result_of(steps, detector, camera=D435I_COLOR):
    """Scores of a run as a dictionary. `detector` is yolov5, depth or exact.

    Lengths are in metres and shares are 0..1. Errors are aggregated over all people in the scene.
    """
    people, found, false = score_detections(steps, *RANGE_M.get(detector, RANGE_M['depth']))
    tracked = score([step.moment for step in steps])
    followed = [person for person in tracked.people if person.ids]
    result = {'detector': detector, 'images': len(steps), 'people': len(tracked.people),
              'recall': found / people if people else 1.0, 'false_boxes': false / max(1, len(steps)),
              'id_switches': sum(person.switches for person in tracked.people),
              'rmse_m': _rms([person.rmse_m for person in followed]),
              'worst_m': max([person.worst_m for person in followed], default=None)}
    result.update(score_tracks([(scored_people(step, camera), step.moment.tracks) for step in steps]))
    return result


def run(arguments):
    yolov5, results = yolov5_detector(arguments.weights) if arguments.weights else None, []
    for path in arguments.scenarios:
        results += _run(path, yolov5)
    return {'scenes': results}


def add_options(parser):
    add_scenarios(parser, 'thesis_*', 'approach_*')
    parser.add_argument('--weights', help='checkpoint or export of YOLOv5; without it, YOLOv5 is not run')


def _run(path, yolov5):
    """Run one scene with each detector and print the results. The error model applies only to the boxes of `exact`."""
    name, simulator, results = scene_name(path), Simulator(read_scenario(path)), []
    cases = [(detector, detector_in(simulator, detector), None) for detector in without_weights()]
    cases += [('yolov5', yolov5, None), ('exact', exact_detector(simulator), read_error_model(SIMULATED_ERROR_MODEL))]
    for detector, detect, model in cases:
        if detect is not None:
            steps = run_scene(simulator, detect, 1 if detector == 'exact' else EVERY, error_model=model)
            result = result_of(steps, detector, simulator.camera)
            print(line_of(name, **result), flush=True)
            results.append(dict(result, scene=name))
    return results
