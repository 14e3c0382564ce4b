"""The pipeline on an RGB-D video with marked people: boxes of each detector, and tracks of this package and Norfair.

The camera does not move, and its pose is fitted to the floor. The videos have no stamps, so the rate of their images is
nominal.
"""
import functools
import os
import tempfile

import numpy as np

from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.detection.network_detector import DetectionParams
from ros_3d_bb.tracking.tracker import Tracker
from ros_3d_bb.tracking.types import CameraView, detections_from_boxes
from ros_3d_bb_lab.evaluation.baselines.norfair_baseline import Norfair
from ros_3d_bb_lab.evaluation.defaults import ROOT, data_folder, default_weights, in_range
from ros_3d_bb_lab.evaluation.detector_benchmark import ignoring_depth, open_networks
from ros_3d_bb_lab.evaluation.detectors import weight_free_detectors
from ros_3d_bb_lab.evaluation.scene_benchmark import boxes3d_of, view_of
from ros_3d_bb_lab.evaluation.text_table import table_of
from ros_3d_bb_lab.evaluation.video.pictures import write_picture
from ros_3d_bb_lab.evaluation.video.recording import read_truth, read_video
from ros_3d_bb_lab.evaluation.video.scores import Step, score_boxes, score_tracks
from ros_3d_bb_lab.evaluation.video.simulated_video import write_simulated_video

MARKED = os.path.join(ROOT, 'test', 'data', 'video')  # truth of recorded videos
START_NS = 100 * NS  # stamp of the first image
OURS, NORFAIR = 'ours', 'norfair'


def track_video(video, pose, detect, rate_hz, trackers):
    """Run the pipeline on a Video. `detect` is a function of a colour and a depth image that returns Detections.

    `trackers` {name: tracker} get the same boxes. Yields (`scores.Step`, colour image).
    """
    for number, (name, color, depth) in enumerate(video.read()):
        detected = detect(color, depth)
        found = dict(enumerate(boxes3d_of(detected, color, depth, video.camera, pose)))
        located, view = detections_from_boxes(found, pose), view_of(depth, video.camera, pose, 'camera')
        stamp_ns = START_NS + int(round(number * NS / rate_hz))
        tracks = {key: tracker.update(stamp_ns, located, view) for key, tracker in trackers.items()}
        yield Step(name, detected.boxes, {index: box.rect_px for index, box in found.items()}, tracks), color


def score_detector(video, pose, truth, detect, rate_hz, pictures=None):
    """Scores of the boxes of a detector and of both trackers on them; pictures of ours are written to a folder."""
    steps, view = [], CameraView(pose, video.camera)
    for step, color in track_video(video, pose, detect, rate_hz, {OURS: Tracker(), NORFAIR: Norfair()}):
        steps.append(step)
        if pictures:
            write_picture(pictures, step, color, truth.frames.get(step.name), OURS, view)
    tracked = {tracker: score_tracks(steps, truth, tracker, view) for tracker in (OURS, NORFAIR)}
    return dict(score_boxes(steps, truth), **tracked[OURS], norfair=tracked[NORFAIR])


def run(arguments):
    """Score each detector on the video."""
    with tempfile.TemporaryDirectory() as folder:
        data = arguments.data or write_simulated_video(folder)
        video = read_video(data)
        truth = read_truth(arguments.truth or truth_path(data), video)
        pose, rate_hz = video.camera_pose(), arguments.rate or truth.rate_hz
        detectors = {name: functools.partial(detect, camera_from_floor=np.linalg.inv(pose))
                     for name, detect in weight_free_detectors(video.camera).items()}
        for name, network in open_networks(arguments.weights, arguments.confidence).items():
            detectors[name] = ignoring_depth(network)
        result = {}
        for name, detect in detectors.items():
            pictures = arguments.pictures and os.path.join(arguments.pictures, name)
            result[name] = score_detector(video, pose, truth, detect, rate_hz, pictures)
    print('%s: %d images, %d marked, %g Hz; camera %.2f m above the floor'
          % (arguments.data or 'simulated', len(video.images), len(truth.frames), rate_hz, pose[2, 3]))
    rows = {}
    for name, row in result.items():
        rows[name], rows[name + ', Norfair'] = row, dict(row, **row[NORFAIR])
    print('\n'.join(table_of(rows)))
    return result


def truth_path(data):
    """The truth in the folder of a video, or that of the package for a video of this name. Raises ValueError."""
    own = os.path.join(data, 'truth.json')
    marked = os.path.join(MARKED, os.path.basename(os.path.normpath(data)) + '.json')
    for path in (own, marked):
        if os.path.isfile(path):
            return path
    raise ValueError('neither %s nor %s exists; the marked people expected, see doc/benchmark_methods.md'
                     % (own, marked))


def add_options(parser):
    recorded = data_folder('piv')
    parser.add_argument('--data', default=recorded and os.path.join(recorded, 'corridor'), metavar='DIR',
                        help='video (default: $ROS_3D_BB_DATA/data/piv/corridor, or simulated)')
    parser.add_argument('--truth', metavar='FILE', help='marked people (default: truth.json of the video, or the file '
                        'of its name in test/data/video)')
    parser.add_argument('--weights', nargs='*', default=list(filter(None, [default_weights()])), metavar='FILE',
                        help='model files: YOLOv5 checkpoints, ONNX files (default: yolov5n.pt in the cache, if any)')
    parser.add_argument('--confidence', type=in_range(float, 0, 1), default=DetectionParams().confidence, metavar='P',
                        help='smallest score of a detection of a network (default: %(default)s)')
    parser.add_argument('--rate', type=in_range(float, 0.1, 1000), metavar='HZ',
                        help='nominal rate of the images (default: that of the truth)')
    parser.add_argument('--pictures', metavar='DIR', help='write the images with the marked people and our tracks to '
                        'a folder in DIR for each detector')
