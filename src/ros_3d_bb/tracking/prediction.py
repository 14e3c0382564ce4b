"""Published tracks: what a TrackedObject states of a track, and the prediction of its positions."""
import functools
import math
from typing import List, NamedTuple, Sequence, Tuple

import numpy as np

from ros_3d_bb.core.params import Param, parameters
from ros_3d_bb.tracking.track import STILL_MOVING, Track
from ros_3d_bb.tracking.types import TrackedObject, prediction_times_s

# Chosen for recorded pedestrians by kind of motion; `./run bench prediction` shows the effect of others.
SLOW_SHARE = 0.4  # of the slow velocity in that of the prediction: people sway as they walk
MANOEUVRE = 2.0  # squared ratio of their difference to the standard deviation at which a manoeuvre has the weight 1/2
# People who walk accelerate less than those who start: density relative to that at rest, and the squared speed at which
# it is halfway between.
WALKING_SHARE, WALKING_M2PS2 = 1 / 3.0, 0.36
LEAST_SPEED2 = 1e-12  # avoids a division by zero
# The numbers of a published track, see `_numbers_of`; (ex, ey) is the velocity of the prediction.
NUMBERS = 'x y z vx vy zero ex ey width depth height manoeuvring xx xy xu xv yy yu yv uu uv vv zz'.split()


def _places(names: str) -> List[int]:
    """The places of names among `NUMBERS`."""
    return [NUMBERS.index(name) for name in names.split()]


IN_PLANE, VARIANCES = _places('xx xy yy'), _places('xx yy')
POSITION, VELOCITY, EXPECTED = _places('x y z'), _places('vx vy zero'), _places('ex ey zero')
SIZE, MANOEUVRING, ZERO = _places('width depth height'), NUMBERS.index('manoeuvring'), NUMBERS.index('zero')
# The covariance of x, y, z and their velocities.
COVARIANCE = np.array([_places(row) for row in (
    'xx xy zero xu xv zero', 'xy yy zero yu yv zero', 'zero zero zz zero zero zero',
    'xu yu zero uu uv zero', 'xv yv zero uv vv zero', 'zero zero zero zero zero zero')])
# It, and the two terms of the covariances of x, y, z that are multiplied by the powers 0, 1, 2 of the time of a
# prediction. All at once, as indexing is slow.
_CROSS, _ZEROS = COVARIANCE[:3, 3:], np.full((3, 3), ZERO)
COVARIANCES = np.concatenate([each.ravel() for each in (
    COVARIANCE, COVARIANCE[:3, :3], _CROSS, COVARIANCE[3:, 3:], _ZEROS, _CROSS.T, _ZEROS)])
LEVEL = np.diag((1.0, 1.0, 0.0)).ravel()  # a covariance (3, 3) of 1 along x and y


@parameters('predictions')
class PredictionParams(NamedTuple):
    """Parameters of the prediction of tracks."""

    prediction_time: float = Param(2.0, 'How far ahead positions are predicted; 2 in the thesis.', 's', live=(0, 10))
    prediction_step: float = Param(0.25, 'Time between predicted positions.', 's', live=(0.05, 1))
    prediction_acceleration: float = Param(
        0.02, 'How much more people turn than the filter models: density of a white acceleration.', 'm^2/s^3',
        live=(0, 1))
    manoeuvre_acceleration: float = Param(
        0.45, 'Additional density of a white acceleration of people who start. People who stop or turn while they walk '
        'have a third of it.',
        'm^2/s^3', live=(0, 2))
    standing_speed: float = Param(
        0.15, 'A velocity much lower than this is not extrapolated: it is mostly noise.', 'm/s', live=(0, 1))
    position_bias: float = Param(
        0.05, 'Standard deviation added for errors that stay the same for seconds.', 'm', live=(0, 0.5))
    pose_sigma: float = Param(
        0.0, 'Standard deviation of the position of the robot in the frame of the tracks, along each axis, such as the '
        'error of its localisation. It is added to the covariances.', 'm', live=(0, 1))
    pose_yaw_sigma: float = Param(
        0.0, 'Standard deviation of the heading of the robot in the frame of the tracks. It is added to the '
        'covariances.', 'rad', live=(0, 0.5))


def learned_prediction(log_scale: float, assumed_m: float, params: PredictionParams) -> PredictionParams:
    """Adapt PredictionParams to the learned scale of the variance `assumed_m`².

    If the scale is below 1, the rest of the variance is that of lasting errors, and slow velocities are less noisy.
    """
    if log_scale >= 0:
        return params
    scale = math.exp(log_scale)
    lasting_m = math.sqrt(max(params.position_bias ** 2, assumed_m ** 2 * (1 - scale)))
    return params._replace(position_bias=lasting_m, standing_speed=params.standing_speed * math.sqrt(scale))


def published(tracks: Sequence[Track], params: PredictionParams, moving_speed: float,
              camera_m: Sequence[float]) -> List[TrackedObject]:
    """Convert tracks to a list of TrackedObject with predictions at constant velocity; `params` are PredictionParams.

    A track that was moving when it was last detected may have been stopped since, see `occlusion.mark_missed`.

    People sway as they walk. The predicted velocity v is therefore between that of the filter and the slow one. A low
    velocity is mostly noise of a standing person, so v is scaled by v² / (v² + standing_speed²). The covariance of the
    filter does not include errors that stay constant for seconds, such as those of a wrong calibration; `position_bias`
    is added for them, and the error of the robot's pose: `pose_sigma`, and `pose_yaw_sigma` about the position (2,) of
    the camera, `camera_m`. A prediction is a mixture of two Gaussians with the same mean: the person goes on, with
    `prediction_acceleration`, or is in a manoeuvre, with `manoeuvre_acceleration` in addition. The covariance is that
    of the mixture.
    """
    if not tracks:
        return []
    numbers = np.array([_numbers_of(track, params.standing_speed ** 2 + LEAST_SPEED2) for track in tracks])
    numbers[:, VARIANCES] += params.position_bias ** 2 + params.pose_sigma ** 2
    across = (numbers[:, :2] - camera_m)[:, ::-1] * (-params.pose_yaw_sigma, params.pose_yaw_sigma)
    numbers[:, IN_PLANE] += across[:, (0, 0, 1)] * across[:, (0, 1, 1)]
    times_s, powers, spread = _times(params.prediction_time, params.prediction_step)
    densities = params.prediction_acceleration + params.manoeuvre_acceleration * numbers[:, MANOEUVRING]
    positions_m, velocities_mps, sizes_m = numbers[:, POSITION], numbers[:, VELOCITY], numbers[:, SIZE]
    predictions_m = positions_m[:, None] + times_s[:, None] * numbers[:, None, EXPECTED]
    covariances = numbers.take(COVARIANCES, axis=1)
    ahead = (covariances[:, 36:63] + covariances[:, 63:]).reshape(-1, 3, 9)
    predictions_m2 = powers @ ahead + densities[:, None, None] * spread
    return [TrackedObject(track.id, position_m, size_m, velocity_mps, track.status,
                          track.is_moving and math.hypot(track.state.u, track.state.v) >= STILL_MOVING * moving_speed,
                          track.first_ns, track.last_ns, prediction_m, params.prediction_step, covariance,
                          prediction_m2, track.kind.label, track.score, track.detection)
            for track, position_m, size_m, velocity_mps, prediction_m, covariance, prediction_m2
            in zip(tracks, positions_m, sizes_m, velocities_mps, predictions_m,
                   covariances[:, :36].reshape(-1, 6, 6),
                   predictions_m2.reshape(len(tracks), -1, 3, 3))]


def _numbers_of(track: Track, standing2: float) -> Tuple[float, ...]:
    """The numbers of a track that are published, in the order of `NUMBERS`.

    A person is in a manoeuvre if the velocity differs from the slow one by more than its covariance explains.
    """
    state, (slow_u, slow_v) = track.state, track.slow_mps
    change_u, change_v = slow_u - state.u, slow_v - state.v
    u, v = state.u + SLOW_SHARE * change_u, state.v + SLOW_SHARE * change_v
    speed2, change2 = u * u + v * v, change_u ** 2 + change_v ** 2
    share = speed2 / (speed2 + standing2)
    manoeuvring = change2 / (change2 + MANOEUVRE * (state.uu + state.vv) / 2 + LEAST_SPEED2)  # its probability
    manoeuvring *= WALKING_SHARE + (1 - WALKING_SHARE) * WALKING_M2PS2 / (WALKING_M2PS2 + speed2)
    x, y, vx, vy, *variances = state
    return (x, y, track.z_m, vx, vy, 0.0, share * u, share * v, *track.size_m, manoeuvring, *variances, track.z_m2)


@functools.lru_cache(maxsize=16)
def _times(time_s: float, step_s: float) -> Tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times of the predictions (steps,), their powers 0 to 2 (steps, 3), and the variances (steps, 9) that a white
    acceleration of density 1 adds.
    """
    times_s = prediction_times_s(time_s, step_s)
    return (times_s, np.stack((times_s ** 0, times_s, times_s ** 2), axis=1), (times_s ** 3 / 3)[:, None] * LEVEL)
