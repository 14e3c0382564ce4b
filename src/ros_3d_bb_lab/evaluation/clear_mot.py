"""CLEAR MOT matching of tracks with ground truth: ID switches, coverage and position errors of each person.

In each image, people and tracks within `GATE_M` in the horizontal plane are matched as in TrackEval's CLEAR metric
(Bernardin and Stiefelhagen 2008): matches of the previous image are kept, then as many others as possible are added
with the least sum of distances. TrackEval itself is not required, because it need not be installed on a robot. An ID
switch is a match with a track other than the last one. Only people and tracks with the status VISIBLE are scored.
"""
from typing import List, NamedTuple

import numpy as np

from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.tracking.association import assign, plane_distances
from ros_3d_bb.tracking.types import VISIBLE, TrackedObject

GATE_M = 1.0
KEPT = 1000  # score of a kept match; other matches have 0.5 at the gate to 1 at distance 0, as in TrackEval
LONGEST_GAP = 1.5  # in image periods; a longer gap ends a visible interval


class Moment(NamedTuple):
    """Stamp of an image, its ground truth, and the tracks after it, in the same fixed frame."""

    stamp_ns: int
    truth: List[TrackedObject]
    tracks: List[TrackedObject]


class MatchedPair(NamedTuple):
    """Matched person and track in one image; `error_m` (2,) is the position error of the track in x and y."""

    person: int
    track: int
    error_m: np.ndarray


class PersonScore(NamedTuple):
    """Tracking scores of one person.

    `visible_s`: total time in which the person is visible; `longest_s`: longest uninterrupted interval; `followed`:
    share 0..1 of the images with the person visible that have a matched track; `ids`: track IDs in order, with an entry
    for each change; `rmse_m` and `worst_m`: RMS and maximum position error of the matched tracks, NaN if there are
    none.
    """

    person: int
    visible_s: float
    longest_s: float
    followed: float
    ids: List[int]
    rmse_m: float
    worst_m: float

    @property
    def switches(self):
        """Number of ID switches."""
        return max(0, len(self.ids) - 1)


class SceneScore(NamedTuple):
    """Tracking scores of a scene; `false_share` is the number of visible false tracks per image."""

    people: List[PersonScore]
    images: int
    false_share: float


def score(moments):
    """Compare tracks with ground truth.

    Parameters
    ----------
    moments : list of Moment
        Ordered by stamp.

    Returns
    -------
    SceneScore
    """
    pairs, false, matcher = [], 0, ClearMatcher()
    for moment in moments:
        seen = [track for track in moment.tracks if track.status == VISIBLE]
        pairs.append(matcher.match(moment.truth, seen))
        false += len(seen) - len(pairs[-1])
    people = sorted(set(person.id for moment in moments for person in moment.truth))
    return SceneScore([_person_score(person, moments, pairs) for person in people], len(moments),
                      false / float(max(1, len(moments))))


class ClearMatcher(object):
    """Matches people with tracks image by image, at distances of at most `gate_m`."""

    def __init__(self, gate_m=GATE_M):
        self._gate_m, self._last_matches = gate_m, {}

    def match(self, people, tracks):
        """Match one image. Returns a list of MatchedPair: kept matches first, then the others by distance."""
        if not people or not tracks:
            return []
        distances_m = plane_distances([person.position_m for person in people], [track.position_m for track in tracks])
        near = distances_m <= self._gate_m
        kept = np.array([[self._last_matches.get(person.id) == track.id for track in tracks] for person in people])
        scores = np.where(near, KEPT * kept + 1 - distances_m / (2 * self._gate_m), 0)
        matches = sorted((match for match in zip(*assign(-scores)) if near[match]), key=lambda match: -scores[match])
        pairs = [MatchedPair(people[row].id, tracks[column].id,
                             tracks[column].position_m[:2] - people[row].position_m[:2])
                 for row, column in matches]
        self._last_matches = {pair.person: pair.track for pair in pairs}
        return pairs


def _person_score(person, moments, pairs):
    ids, errors_m, shown_ns = [], [], []
    for moment, found in zip(moments, pairs):
        if not any(other.id == person and other.status == VISIBLE for other in moment.truth):
            continue
        shown_ns.append(moment.stamp_ns)
        for pair in found:
            if pair.person == person:
                errors_m.append(np.linalg.norm(pair.error_m))
                if ids[-1:] != [pair.track]:
                    ids.append(pair.track)
    lengths_s = _stretches_s(shown_ns, [moment.stamp_ns for moment in moments])
    return PersonScore(person, sum(lengths_s), max(lengths_s, default=0.0),
                       len(errors_m) / float(max(1, len(shown_ns))), ids,
                       float(np.sqrt(np.mean(np.square(errors_m)))) if errors_m else float('nan'),
                       max(errors_m, default=float('nan')))


def _stretches_s(shown_ns, all_ns):
    """Durations of the intervals in which a person is visible, without longer gaps between images."""
    period_ns = np.median(np.diff(all_ns)) if len(all_ns) > 1 else 0
    gaps = np.flatnonzero(np.diff(shown_ns) > LONGEST_GAP * period_ns) + 1
    return [(stretch[-1] - stretch[0]) / NS for stretch in np.split(np.array(shown_ns, np.int64), gaps) if len(stretch)]


def table(scene_score):
    """Format the scores as lines of text."""
    lines = ['person  visible   tracked  ID switches  track IDs     RMSE     worst']
    for person in scene_score.people:
        lines.append('%6d  %5.1f s  %6.0f %%  %11d  %-9s  %6.3f m  %6.3f m'
                     % (person.person, person.visible_s, 100 * person.followed, person.switches,
                        ' '.join(map(str, person.ids)) or '-', person.rmse_m, person.worst_m))
    lines.append('%d images, %.3f false tracks per image' % (scene_score.images, scene_score.false_share))
    return lines
