"""Detectors on the images of a measurement session: people found, overlap with the recorded boxes, and CPU time.

Any number of models, of any format, and the detectors without weights process each image in turn, so that
other load on the machine affects all of them equally and the ratios of their times remain valid. Times are CPU times
from the image to the boxes, with one thread. Scores differ between families of networks, so the confidence with the
highest F1 score is given for each network.
"""
import os
import tempfile
import time

import cv2
import numpy as np

from ros_3d_bb.detection.boxes import iou
from ros_3d_bb.detection.network_detector import MAX_INPUT_PX, DetectionParams
from ros_3d_bb.sessions.session_reader import read_color, read_depth, read_session
from ros_3d_bb_lab.evaluation.defaults import data_folder, default_weights, describe_machine, in_range
from ros_3d_bb_lab.evaluation.detection_ranges import found_at_ranges
from ros_3d_bb_lab.evaluation.detectors import weight_free_detectors
from ros_3d_bb_lab.evaluation.simulated_session import write_simulated_session
from ros_3d_bb_lab.evaluation.text_table import table_of

FOUND_IOU = 0.5
CONFIDENCES = np.arange(5, 100) / 100.0  # among which the best one is searched
WARM_UPS = 3  # images that are not timed
SIMULATED = (2.0, 3.0, 4.0), (-0.25, 0.0, 0.25), 1  # arguments of write_simulated_session


def open_networks(paths, confidence, sizes=(0,)):
    """Open model files as the nodes do. Returns the NetworkDetectors by the names of the files and the `sizes` of their
    input (0: the default), which do not apply to files with a fixed size.

    Raises ValueError if a file cannot be used, or has no class `person`.
    """
    from ros_3d_bb.detection.yolov5.backends import RuntimeParams, open_detector  # may import torch (slow)
    running, networks = RuntimeParams(device='cpu', threads=1), {}
    for name, path in named(paths).items():
        network = open_detector(path, DetectionParams(confidence=confidence), running)
        for size in sizes[:1] if network.has_fixed_size else sizes:
            sized = network.with_params(DetectionParams(confidence=confidence, image_size=size))
            networks['%s %d' % (name, sized.input_px) if len(sizes) > 1 else name] = sized
    return networks


def ignoring_depth(network):
    return lambda color, _depth: network.detect(color)


def compare(session, detectors):
    """Run detectors on the images of a session that have recorded boxes. Raises ValueError if there are none.

    `detectors` are functions, by name, of a color image and a DepthImage that return Detections. Returns a
    dictionary: `frames`, their number; `boxes`, the number of their boxes; and `detectors`, by name: `found` boxes with
    an IoU of at least 0.5, `median_iou` of all recorded boxes with the best detection (0 without), `false_boxes`
    without a recorded box, and `cpu_ms`, the median of the CPU times.
    """
    frames = annotated_frames(session)
    overlaps, false_boxes, times_ms = ({name: [] for name in detectors} for _result in range(3))
    warm_up = frames[:WARM_UPS]
    for number, frame in enumerate(warm_up + frames):
        images = read_color(frame, session.camera), read_depth(frame, session)
        recorded = np.array(frame.boxes_px, float)
        for name, detect in detectors.items():
            start_s = time.process_time()
            found = detect(*images).boxes
            spent_ms = 1e3 * (time.process_time() - start_s)
            if number >= len(warm_up):
                table = np.zeros((len(recorded), len(found) + 1))  # the last column: no box
                table[:, :-1] = [iou(box, found) for box in recorded]
                overlaps[name].extend(table.max(axis=1).tolist())
                false_boxes[name].append(int((table[:, :-1].max(axis=0) < FOUND_IOU).sum()))
                times_ms[name].append(spent_ms)
    return {'frames': len(frames), 'boxes': sum(len(frame.boxes_px) for frame in frames), 'detectors': {
        name: {'found': int(np.sum(np.array(overlaps[name]) >= FOUND_IOU)),
               'median_iou': float(np.median(overlaps[name])), 'false_boxes': sum(false_boxes[name]),
               'cpu_ms': float(np.median(times_ms[name]))} for name in detectors}}


def annotated_frames(session):
    """Frames of a session that have 2D boxes. Raises ValueError if there is none."""
    frames = [frame for frame in session.frames if frame.boxes_px]
    if not frames:
        raise ValueError('the session has no images with 2D boxes')
    return frames


def best_confidence(session, network):
    """Confidence of a NetworkDetector with the highest F1 score on the recorded boxes of a session, and that score.

    Suppression keeps the best boxes, so the detections above a confidence are
    those of a lower confidence with a score above it.
    """
    network = network.with_params(DetectionParams(confidence=CONFIDENCES[0], image_size=network.input_px))
    found, false = [], []  # scores of the best detection of each recorded box, and of detections of no recorded box
    for frame in annotated_frames(session):
        detections = network.detect(read_color(frame, session.camera))
        overlaps = np.array([iou(box, detections.boxes) for box in np.array(frame.boxes_px, float)])
        is_match = overlaps >= FOUND_IOU
        found.extend(detections.scores[row].max() if row.any() else 0 for row in is_match)
        false.extend(detections.scores[~is_match.any(axis=0)])
    found, false = np.array(found), np.array(false)
    hits = (found > CONFIDENCES[:, None]).sum(axis=1)
    false_boxes = (false > CONFIDENCES[:, None]).sum(axis=1)
    f1 = 2.0 * hits / (hits + false_boxes + len(found))
    best = np.flatnonzero(f1 == f1.max())
    best = best[len(best) // 2]  # of several, the middle one is the farthest from a change of the counts
    return float(CONFIDENCES[best]), float(f1[best])


def named(paths):
    """File names by which models are distinguished, or their paths if two have the same name: {name: path}."""
    names = [os.path.basename(path) for path in paths]
    return {name if names.count(name) == 1 else path: path for name, path in zip(names, paths)}


def run(arguments):
    """Compare the detectors on the session."""
    cv2.setNumThreads(1)
    with tempfile.TemporaryDirectory() as folder:
        session = read_session(arguments.data or write_simulated_session(folder, *SIMULATED))
        session = session._replace(frames=session.frames[::arguments.every])
        networks = open_networks(arguments.weights, arguments.confidence, arguments.sizes)
        if arguments.ranges:
            rows = found_at_ranges(annotated_frames(session), session.camera, networks, arguments.ranges, FOUND_IOU)
            print('\n'.join(table_of(rows)))
            return {'machine': describe_machine(), 'ranges': rows}
        detectors = {name: ignoring_depth(network) for name, network in networks.items()}
        detectors.update(weight_free_detectors(session.camera))
        result = dict(compare(session, detectors), machine=describe_machine())
        rows = result['detectors']
        for name, network in networks.items():
            rows[name]['best_confidence'], rows[name]['best_f1'] = best_confidence(session, network)
        first_ms = next(iter(rows.values()))['cpu_ms']
        for row in rows.values():
            row['ratio'] = row['cpu_ms'] / first_ms
    print('%s\n%d images, %d people' % (result['machine'], result['frames'], result['boxes']))
    print('\n'.join(table_of(rows)))
    return result


def add_options(parser):
    parser.add_argument('--weights', nargs='+', default=list(filter(None, [default_weights()])), metavar='FILE',
                        help='model files: YOLOv5 checkpoints, ONNX files (default: yolov5n.pt in the cache, if any)')
    parser.add_argument('--data', default=data_folder('thesis'), metavar='DIR',
                        help='measurement session (default: $ROS_3D_BB_DATA/data/thesis, or simulated)')
    parser.add_argument('--every', type=in_range(int, 1), default=1, metavar='N',
                        help='use every Nth image (default: 1)')
    parser.add_argument('--sizes', nargs='+', type=in_range(int, 0, MAX_INPUT_PX), default=[0], metavar='PX',
                        help='longer sides of the input of networks that accept any (default: 640)')
    parser.add_argument('--ranges', nargs='+', type=in_range(float, 1, 100), metavar='M',
                        help='count the people found at these ranges only, in images that are shrunk accordingly')
    parser.add_argument('--confidence', type=in_range(float, 0, 1), default=DetectionParams().confidence, metavar='P',
                        help='smallest score of a detection of a network (default: %(default)s)')
