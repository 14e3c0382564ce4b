"""Pipeline without ROS on a simulated scene: 2D detection, 3D boxes and tracking, image by image."""
import functools
from typing import NamedTuple

import numpy as np

from ros_3d_bb.camera.camera_model import transform_points
from ros_3d_bb.camera.images import DepthImage
from ros_3d_bb.core.object_classes import PERSON
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.detection.boxes import iou
from ros_3d_bb.estimation.box3d import plausible
from ros_3d_bb.estimation.box3d_estimator import estimate_boxes, estimator_named, level_rotation
from ros_3d_bb.estimation.error_model import corrected_boxes
from ros_3d_bb.tracking.association import match_greedily
from ros_3d_bb.tracking.occlusion import depths_towards
from ros_3d_bb.tracking.tracker import Tracker
from ros_3d_bb.tracking.types import CameraView, detections_from_boxes
from ros_3d_bb_lab.evaluation.clear_mot import Moment
from ros_3d_bb_lab.simulation.simulator import SimulatedFrame

FOUND_IOU = 0.5  # minimum IoU of a true positive


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
        depth = DepthImage(frame.depth_mm, 0.001)
        stamp_ns = int(round(frame.time_s * NS))
        people = [track for track in simulator.true_tracks(frame, stamp_ns) if track.label == PERSON]
        detections = detections_in(depth, detected, simulator.camera, frame.poses.map_from_camera, error_model)
        view = CameraView(frame.poses.map_from_camera, simulator.camera, frame.camera,
                          functools.partial(depths_towards, simulator.camera, depth))
        tracks = tracker.update(stamp_ns, detections, view)
        steps.append(Step(frame._replace(color=None, depth_mm=None), detected.boxes, Moment(stamp_ns, people, tracks)))
    return steps


def detections_in(depth, detected, camera, map_from_camera, error_model):
    """Convert 2D detections to detections in the map, as bbox3d_node and tracker_node do."""
    rects_px = np.rint(detected.boxes).astype(int)
    usable = (rects_px[:, :2] < rects_px[:, 2:]).all(axis=1)
    estimated = estimate_boxes(depth, list(map(tuple, rects_px[usable].tolist())), camera,
                               estimator_named('foreground'),
                               level_from_camera=level_rotation(map_from_camera[2, :3]))
    found = corrected_boxes([box._replace(score=score) for box, score in zip(estimated, detected.scores[usable])
                             if plausible(box)], error_model)
    return detections_from_boxes(dict(enumerate(found)), map_from_camera)


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
        pairs = [pair for pair in match_greedily(-overlaps) if overlaps[pair] >= FOUND_IOU]
        false += len(step.boxes) - len(pairs)
        found_people = set(column for _row, column in pairs)
        camera_from_map = np.linalg.inv(step.frame.poses.map_from_camera)
        for column, person in enumerate(shown):
            depth_m = transform_points(camera_from_map, person.position_m)[2]
            if person.visible >= least_visible and nearest_m <= depth_m <= farthest_m:
                people += 1
                found += column in found_people
    return people, found, false
