"""Tracks as a structured array: update of matched tracks and start of new ones. Fixed frame, metres, nanoseconds."""
import numpy as np

from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.tracking import kalman_filter
from ros_3d_bb.tracking.types import VISIBLE

# `hits` counts the detections of a track, `end_hits` those that showed the lower and the upper end of the body.
# `unseen_s` is the time since the last detection, `missed_s` the part of it during which a detection was expected.
TRACK = np.dtype([('id', int), ('mean', float, 4), ('covariance', float, (4, 4)), ('z_m', float), ('z_m2', float),
                  ('size_m', float, 3), ('end_hits', int, 2), ('hits', int), ('first_ns', np.int64),
                  ('last_ns', np.int64), ('missed_s', float), ('unseen_s', float), ('status', int),
                  ('confirmed', bool), ('moving', bool)])
RECENTLY_MATCHED_NS = NS // 5  # no track starts near a track that was matched less than this ago
SMOOTHING = 0.1  # weight of the newest detection in size and height
CUT_SMOOTHING = 0.02  # the same for boxes that the image border truncates sideways: the head may be outside
LEAST_HEIGHT_M = 0.1
STILL_MOVING = 0.5  # hysteresis: a moving track stops below this share of `moving_speed`


def update_matched(tracks, rows, batch, stamp_ns, params, outliers):
    """Update the tracks in `rows`, in place, with one detection each.

    Parameters
    ----------
    tracks : numpy.ndarray of TRACK, (n,)
        Predicted to the stamp.
    rows : numpy.ndarray of int, (m,)
    batch : measurement_model.MeasurementBatch
        m measurements.
    stamp_ns : int
    params : tracker.TrackerParams
    outliers : kalman_filter.Outliers
    """
    matched = tracks[rows]
    matched['mean'], matched['covariance'] = kalman_filter.update(matched['mean'], matched['covariance'], batch.ground,
                                                                  outliers)
    matched['hits'] += 1
    matched['last_ns'], matched['unseen_s'], matched['missed_s'], matched['status'] = stamp_ns, 0, 0, VISIBLE
    is_old_enough = stamp_ns - matched['first_ns'] >= params.min_age * NS
    matched['confirmed'] |= is_old_enough & (matched['hits'] >= params.min_hits)
    speed_mps = np.linalg.norm(matched['mean'][:, 2:], axis=1)
    matched['moving'] = speed_mps >= params.moving_speed * np.where(matched['moving'], STILL_MOVING, 1)
    _update_size(matched, batch)
    tracks[rows] = matched


def new_targets(tracks, batch, stamp_ns, params):
    """Start tracks from unmatched measurements, except duplicate detections of recently matched or new tracks.

    Parameters
    ----------
    tracks : numpy.ndarray of TRACK, (n,)
    batch : measurement_model.MeasurementBatch
        m measurements.
    stamp_ns : int
    params : tracker.TrackerParams

    Returns
    -------
    new : numpy.ndarray of TRACK, (k,)
        New tracks; their IDs are not set.
    kept : list of int
        Indices of the measurements that started them.
    """
    new = np.zeros(len(batch.z_m), TRACK)
    new['mean'][:, :2] = batch.ground.positions_m
    new['covariance'][:, :2, :2] = batch.ground.noise_m2
    new['covariance'][:, [2, 3], [2, 3]] = params.initial_speed ** 2
    new['size_m'], new['z_m'], new['z_m2'] = batch.sizes_m, batch.z_m, batch.z_m2
    new['end_hits'] = ~batch.vertical_cuts
    new['hits'], new['first_ns'], new['last_ns'] = 1, stamp_ns, stamp_ns
    occupied_m = tracks['mean'][stamp_ns - tracks['last_ns'] < RECENTLY_MATCHED_NS, :2]
    kept = []
    for row, position_m in enumerate(new['mean'][:, :2]):
        others_m = np.concatenate((occupied_m, new['mean'][kept, :2]))
        if (np.linalg.norm(others_m - position_m, axis=1) >= params.duplicate_distance).all():
            kept.append(row)
    return new[kept], kept


def _update_size(matched, batch):
    """Smooth the size and the height of each track with one detection.

    The lower and the upper end are smoothed separately. A truncated end moves with the other one, so that the height
    stays constant. An end that has never been visible is placed where the estimator expects it.
    """
    cut = batch.vertical_cuts
    matched['end_hits'] += ~cut
    held = cut & (matched['end_hits'] > 0)
    end_share = np.where(held, 0, np.maximum(SMOOTHING, 1 / np.maximum(matched['end_hits'], 1)))
    share = np.maximum(SMOOTHING, 1 / matched['hits'])
    share[batch.cut_sideways] = CUT_SMOOTHING
    end_share = np.minimum(end_share, np.where(batch.cut_sideways, CUT_SMOOTHING, 1)[:, None])
    up_m, taller_m = batch.z_m - matched['z_m'], batch.sizes_m[:, 2] - matched['size_m'][:, 2]
    lower_m, upper_m = end_share[:, 0] * (up_m - taller_m / 2), end_share[:, 1] * (up_m + taller_m / 2)
    lower_m = np.where(held[:, 0], upper_m, lower_m)
    upper_m = np.where(held[:, 1], lower_m, upper_m)
    matched['size_m'][:, :2] += share[:, None] * (batch.sizes_m[:, :2] - matched['size_m'][:, :2])
    matched['size_m'][:, 2] = np.maximum(matched['size_m'][:, 2] + upper_m - lower_m, LEAST_HEIGHT_M)
    matched['z_m'] += (lower_m + upper_m) / 2
    matched['z_m2'] += end_share.mean(axis=1) * (batch.z_m2 - matched['z_m2'])
