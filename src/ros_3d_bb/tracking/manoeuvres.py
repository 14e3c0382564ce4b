"""Sudden motions: people who start to run, turn or stop between two images, and leave the gate.

At low image rates, the filter expects such a person elsewhere. A track that was detected recently and a box that is
within reach of that detection belong together all the same if their heights are similar, unless another track or box is
within reach, too: the association decides contested pairs by their likelihood.

The reach is the distance that a person covers since the latest box. It is not measured from the prediction, which
overshoots where a person turns. People who have been missed since then may have stopped or turned, but not started.
"""
import math
from typing import Any, List, Sequence, Tuple

from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.tracking.association import height_cost
from ros_3d_bb.tracking.kalman_filter import State, faster
from ros_3d_bb.tracking.measurement_model import Measurement
from ros_3d_bb.tracking.track import Track

# All are chosen; `./run bench tracking --rates` shows the effect of others.
RUNNING_MPS = 6.0  # of tentative tracks, whose velocity is unknown: people run no faster indoors
STARTING_MPS = 1.5  # the speed of a person who starts to walk; walking people who turn are no faster than before
BESIDE_M = 0.1  # difference of two boxes of a standing person
SIMILAR_COST = 2.0  # of heights: a difference of two standard deviations
RECENT_NS = 4 * NS // 10  # a person who is missed for less may have stopped or turned
LONGEST_NS = NS  # between two images: after longer, anyone may be within reach


def match_manoeuvres(tracks: Sequence[Track], measurements: Sequence[Measurement],
                     matches: Sequence[Tuple[Track, Measurement]], latest_ns: int, stamp_ns: int,
                     height_sigma_m: float) -> List[Tuple[Track, Measurement]]:
    """The pairs (Track, Measurement) outside of the gate that have no other candidates.

    `matches` are those of the association, `latest_ns` is the stamp of the latest image of the camera. The velocities
    of the tracks become as uncertain as their motion to the measurement. Unless this is nearer to the prediction, the
    motion starts at rest at the latest box: a wrong velocity must not lead away from boxes that agree.
    """
    earliest_ns = max(min(latest_ns, stamp_ns - RECENT_NS), stamp_ns - LONGEST_NS)
    seen = [track for track in tracks if earliest_ns <= track.last_ns < stamp_ns]
    matched = set(track.id for track, _measurement in matches)
    taken = set(measurement.number for _track, measurement in matches)

    def is_within_reach(track: Track, measurement: Measurement) -> bool:
        speed_mps = math.hypot(track.state.u, track.state.v)
        if track.last_ns >= latest_ns:
            speed_mps = max(speed_mps, STARTING_MPS) if track.is_confirmed else RUNNING_MPS
        reach_m = speed_mps * (stamp_ns - track.last_ns) / NS + BESIDE_M
        return (track.kind.group == measurement.kind.group and _distance_m(track.latest, measurement) < reach_m
                and height_cost(track, measurement, height_sigma_m) < SIMILAR_COST)

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
    state = track.state
    if _distance_m(state, measurement) >= _distance_m(track.latest, measurement):
        state = state._replace(x=track.latest.x, y=track.latest.y, u=0.0, v=0.0)
    shift_m = max(_distance_m(state, measurement) - BESIDE_M, 0)
    return faster(state, elapsed_s, (shift_m / elapsed_s) ** 2)


def _distance_m(place: Any, box: Any) -> float:
    return math.hypot(box.x - place.x, box.y - place.y)
