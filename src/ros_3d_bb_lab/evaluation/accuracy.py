"""Accuracy of positions in a measurement session: our estimator, that of the thesis, and recorded estimates.

Without an error model, each position is corrected by a model fitted to all other positions. The thesis' estimator is
always corrected in this way if there are enough positions. Recorded estimates are not corrected; frames without a box
are skipped.
"""
from typing import Any, NamedTuple, Optional

import numpy as np

from ros_3d_bb.detection.boxes import iou
from ros_3d_bb.estimation.box3d_estimator import estimator_named
from ros_3d_bb.estimation.error_model import read_error_model, write_error_model
from ros_3d_bb.sessions.session_reader import annotated_people, read_color, read_depth, read_session
from ros_3d_bb_lab.evaluation.defaults import data_folder, default_weights
from ros_3d_bb_lab.evaluation.error_model_fit import coverage, data_of, fit_error_model, held_out
from ros_3d_bb_lab.evaluation.text_table import line_of, table_of, transposed

LENGTHS = ('rmse_x_m', 'rmse_z_m', 'rmse_plane_m', 'p95_plane_m', 'bias_x_m', 'bias_z_m', 'repeatability_x_m',
           'repeatability_z_m', 'rmse_x_truncated_m')
SHARES = ('coverage_68', 'coverage_95')
CALIBRATIONS = ('leave-one-position-out', 'error model')


class Estimates(NamedTuple):
    """Raw and corrected positions (n, 3) from one estimator, NaN if missing, and covariances (n, 3, 3) or None."""

    raw_m: np.ndarray
    position_m: np.ndarray
    covariances: Optional[Any]


def with_detected_boxes(session, weights):
    """The session with boxes of YOLOv5 of the annotated people; None for those who are not detected."""
    from ros_3d_bb.detection.yolov5.backends import RuntimeParams, open_detector  # may import torch (slow)
    detector, frames = open_detector(weights, running=RuntimeParams(device='cpu')), []
    for frame in session.frames:
        boxes = detector.detect(read_color(frame, session.camera)).boxes
        overlaps = iou(frame.boxes_px[0], boxes)
        found = len(boxes) > 0 and overlaps.max() > 0
        box_px = tuple(np.rint(boxes[overlaps.argmax()]).astype(int).tolist()) if found else None
        detections = list(frame.detections)
        detections[frame.person] = detections[frame.person]._replace(box_px=box_px)
        frames.append(frame._replace(detections=tuple(detections)))
    return session._replace(frames=tuple(frames))


def corrected(session, raw_m, model=None):
    """Estimates corrected by an error model, by default one fitted to all other positions for each position."""
    truth_m = truth_of(session)
    seen = np.isfinite(raw_m[:, 0])
    position_m, covariances = raw_m.copy(), np.full(raw_m.shape + (3,), np.nan)
    if model is not None:
        position_m[seen] = model.corrected(raw_m[seen])
        covariances[seen] = model.covariance(position_m[seen])
    else:
        position_m[seen], covariances[seen] = held_out(data_of(raw_m[seen], truth_m[seen]))
    return Estimates(raw_m, position_m, covariances)


def raw_positions(session, depths, estimator):
    """Estimated position in each frame, (n, 3), NaN if there is no estimate, considering the boxes of other people,
    given the DepthImage of each frame."""
    boxes = [frame.estimate(depth, session.camera, estimator) for frame, depth in zip(session.frames, depths)]
    return np.array([np.full(3, np.nan) if box is None else box.center_m for box in boxes])


def truth_of(session):
    return np.array([frame.truth_m[::2] for frame in session.frames])


def are_truncated(session):
    """Whether the image border truncates the box in each frame, (n,)."""
    return np.array([any(frame.truncated_edges(session.camera)) for frame in session.frames])


def scores_of(estimates, truth_m, truncated):
    """Scores of estimates against the truth (n, 2) as a dictionary. A score that cannot be computed is None.

    `truncated` (n,) is whether the image border truncates the box.
    """
    seen = np.isfinite(estimates.position_m[:, 0])
    error_m = (estimates.position_m[:, [0, 2]] - truth_m)[seen]
    rmse_m = np.sqrt(np.mean(error_m ** 2, axis=0))
    truncated_x_m = error_m[truncated[seen], 0]
    shares = (np.nan, np.nan) if estimates.covariances is None else coverage(error_m, estimates.covariances[seen])
    values = (*rmse_m, np.hypot(*rmse_m), np.percentile(np.hypot(*error_m.T), 95), *error_m.mean(axis=0),
              *_repeatability_m(error_m, truth_m[seen]),
              np.sqrt(np.mean(truncated_x_m ** 2)) if truncated_x_m.size else np.nan, *shares)
    scores = dict(zip(LENGTHS + SHARES, _numbers(values)))
    return dict(scores, missed=int(np.count_nonzero(~seen)))


def _repeatability_m(error_m, truth_m):
    """Standard deviation of repeated measurements, (2,): RMS over the positions with at least three measurements."""
    repeated = [error_m[(truth_m == position_m).all(axis=1)] for position_m in np.unique(truth_m, axis=0)]
    variances = [errors_m.var(axis=0) for errors_m in repeated if len(errors_m) > 2]
    return np.sqrt(np.mean(variances, axis=0)) if variances else np.full(2, np.nan)


def compare(session, estimator, model=None):
    """Compare the estimators on a session. Returns scores and positions as a dictionary, and our `Estimates`."""
    truth_m, truncated = truth_of(session), are_truncated(session)
    depths = [read_depth(frame, session) for frame in session.frames]
    ours = corrected(session, raw_positions(session, depths, estimator), model)
    thesis = _thesis_estimates(session, depths)
    recorded_m = np.array([np.full(3, np.nan) if frame.estimate_m is None or not frame.boxes_px else frame.estimate_m
                           for frame in session.frames])
    recorded = Estimates(recorded_m, recorded_m, None) if np.isfinite(recorded_m[:, 0]).any() else None
    names = 'ours', 'thesis', 'truth', 'ours_raw', 'thesis_raw'
    rows = zip(session.frames, ours.position_m, thesis.position_m, truth_m, ours.raw_m, thesis.raw_m)
    return {'frames': len(session.frames), 'positions': len(np.unique(truth_m, axis=0)),
            'calibration': CALIBRATIONS[model is not None],
            'thesis_calibration': 'none' if thesis.covariances is None else CALIBRATIONS[0],
            'ours': scores_of(ours, truth_m, truncated),
            'uncorrected': scores_of(Estimates(ours.raw_m, ours.raw_m, None), truth_m, truncated),
            'thesis': scores_of(thesis, truth_m, truncated),
            'recorded': None if recorded is None else scores_of(recorded, truth_m, truncated),
            'per_frame': [dict([('id', frame.id), *zip(names, map(_numbers, values))])
                          for frame, *values in rows]}, ours


def _thesis_estimates(session, depths):
    """Estimates of the thesis' estimator, uncorrected if there are too few positions."""
    raw_m = raw_positions(session, depths, estimator_named('median'))
    try:
        return corrected(session, raw_m)
    except ValueError:
        return Estimates(raw_m, raw_m, None)


def _numbers(values):
    return [float(value) if np.isfinite(value) else None for value in values]


def run(arguments):
    """Compare the estimators on the session."""
    if not arguments.data:
        raise ValueError('no --data given, and ROS_3D_BB_DATA is not set')
    if arguments.boxes == 'yolov5' and not arguments.weights:
        raise ValueError('--boxes yolov5 needs --weights')
    session = read_session(arguments.data)
    session = session._replace(frames=tuple(annotated_people(session.frames)))
    if not session.frames:
        raise ValueError('%s has no frame with ground truth' % arguments.data)
    model = read_error_model(arguments.error_model) if arguments.error_model else None
    if model is not None:
        model.check_estimator(arguments.estimator)
    for frame in session.frames:
        if not frame.boxes_px:
            raise ValueError('frame %s has no 2D box; all frames with ground truth need one' % frame.id)
    if arguments.boxes == 'yolov5':
        session = with_detected_boxes(session, arguments.weights)
    result, ours = compare(session, estimator_named(arguments.estimator), model)
    result.update(boxes=arguments.boxes, estimator=arguments.estimator)
    if arguments.fit:
        seen = np.isfinite(ours.raw_m[:, 0])
        write_error_model(arguments.fit, fit_error_model(
            ours.raw_m[seen], truth_of(session)[seen], estimator=arguments.estimator))
    print(line_of(**{key: value for key, value in result.items() if isinstance(value, (int, str))}))
    names = 'ours', 'uncorrected', 'thesis', 'recorded'
    estimators = {name: result[name] for name in names if result[name] is not None}
    print('\n'.join(table_of(transposed(estimators))))
    return result


def add_options(parser):
    parser.add_argument('--data', default=data_folder('thesis'), metavar='DIR',
                        help='a measurement session (default: $ROS_3D_BB_DATA/data/thesis)')
    parser.add_argument('--error-model', metavar='FILE', help='error model for the correction (default: models fitted '
                        'to the other positions)')
    parser.add_argument('--fit', metavar='FILE', help='also write an error model fitted to all frames')
    parser.add_argument('--boxes', choices=('recorded', 'yolov5'), default='recorded', help='default: recorded')
    parser.add_argument('--weights', default=default_weights(), help='checkpoint or export, for --boxes yolov5')
    parser.add_argument('--estimator', default='foreground', metavar='NAME', help='default: foreground')
