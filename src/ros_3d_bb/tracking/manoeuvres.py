"""Sudden motions: people who start to run, turn, stop or sit down between two images, and leave the gate.

At low image rates, the filter expects such a person elsewhere. A track that was detected in the latest image and a box
that is within reach of that detection belong together all the same, unless another track or box is within reach, too:
the association decides contested pairs by their likelihood.

The reach is the distance that a person covers in the time between two images. It is measured from the latest box and
not from the prediction, because the prediction overshoots where a person turns. A track without a box in the latest
image has no such reach, because the person may be occluded, and the box that of another one. If it was detected just
before, only a box on this side of its predicted place belongs to it, as of a person who crouches, stops or turns.
"""
import math
from typing import Any, List, Sequence, Tuple

from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.tracking.association import HIDDEN_FEET_COST, height_cost
from ros_3d_bb.tracking.kalman_filter import State, faster
from ros_3d_bb.tracking.measurement_model import Measurement
from ros_3d_bb.tracking.track import HIT_CORRELATION_S, LatestBox, Track

# All are chosen; `./run bench tracking --rates` shows the effect of others.
RUNNING_MPS = 6.0  # of new tracks, whose velocity is unknown: people run no faster indoors
TURNING_MPS = 1.5  # beside the speed of the track: walking people start, stop and turn within this change of velocity
BESIDE_M = 0.1  # difference of two boxes of a standing person
RISING_MPS, MOST_RISE_M = 2.0, 0.5  # of heads: people who sit down, stand up or bend are slower, or do so for longer
BESIDE_SIGMAS = 2.0  # difference of the heads of two boxes of a standing person, relative to `height_sigma`
SETTLED_NS = NS // 2  # the velocity of a track is known this long after its first detection
RECENT_NS = 4 * NS // 10  # a person who is missed for less may have stopped or turned
STOPPED = 0.7  # share of the way to the predicted place that such a person has gone at most
LONGEST_NS = NS  # between two images; chosen: after longer, anyone may be within reach


def match_manoeuvres(tracks: Sequence[Track], measurements: Sequence[Measurement],
                     matches: Sequence[Tuple[Track, Measurement]], latest_ns: int, stamp_ns: int,
                     height_sigma_m: float) -> List[Tuple[Track, Measurement]]:
    """The pairs (Track, Measurement) outside of the gate that have no other candidates.

    `matches` are those of the association, `latest_ns` is the stamp of the latest image of the camera. The velocities
    of the tracks become as uncertain as their motion to the measurement. Unless this is nearer to the prediction, as of
    people who bend while they walk, the motion starts at rest at the latest box: a wrong velocity must not lead away
    from boxes that agree. At high rates, both boxes may be outliers.
    """
    earliest_ns = max(min(latest_ns, stamp_ns - RECENT_NS), stamp_ns - LONGEST_NS)
    seen = [track for track in tracks if earliest_ns <= track.last_ns < stamp_ns]
    matched = set(track.id for track, _measurement in matches)
    taken = set(measurement.number for _track, measurement in matches)

    def is_within_reach(track: Track, measurement: Measurement) -> bool:
        return _is_within_reach(track, measurement, stamp_ns, track.last_ns >= latest_ns, height_sigma_m)

    pairs = []
    for track in seen:
        if track.id not in matched:
            near = [measurement for measurement in measurements if is_within_reach(track, measurement)]
            if len(near) == 1 and near[0].number not in taken and not any(
                    is_within_reach(other, near[0]) for other in seen if other is not track):
                pairs.append((track, near[0]))
    for track, measurement in pairs:
        track.state = _released(track, measurement, (stamp_ns - track.last_ns) / NS)
    return pairs


def _released(track: Track, measurement: Measurement, elapsed_s: float) -> State:
    """The State of a track whose velocity is as uncertain as its motion to a measurement."""
    state, shift_m = track.state, _distance_m(track.latest, measurement)
    if elapsed_s >= HIT_CORRELATION_S:
        if _distance_m(state, measurement) >= shift_m:
            state = state._replace(x=track.latest.x, y=track.latest.y, u=0.0, v=0.0)
        shift_m = _distance_m(state, measurement)
    return faster(state, elapsed_s, (max(shift_m - BESIDE_M, 0) / elapsed_s) ** 2)


def _is_within_reach(track: Track, measurement: Measurement, stamp_ns: int, may_move: bool,
                     height_sigma_m: float) -> bool:
    """Whether the object of a track, which stops or turns unless it `may_move` on, may be at a measurement."""
    if track.kind.group != measurement.kind.group:
        return False
    elapsed_s, box = (stamp_ns - track.last_ns) / NS, LatestBox.of(measurement)
    walking_mps = math.hypot(track.state.u, track.state.v)
    if stamp_ns - track.first_ns < SETTLED_NS:
        moving_mps = RUNNING_MPS
        is_similar = height_cost(track, measurement, height_sigma_m) < HIDDEN_FEET_COST
    else:
        moving_mps = walking_mps + TURNING_MPS
        rise_m = min(RISING_MPS * elapsed_s, MOST_RISE_M) + BESIDE_SIGMAS * height_sigma_m
        is_similar = track.is_confirmed and abs(box.head_m - track.latest.head_m) < rise_m
    speed_mps = moving_mps if may_move else STOPPED * walking_mps
    return is_similar and _distance_m(track.latest, box) < speed_mps * elapsed_s + BESIDE_M


def _distance_m(place: Any, box: Any) -> float:
    """Distance of a box from a place in the plane."""
    return math.hypot(box.x - place.x, box.y - place.y)
