"""CLEAR MOT matching of tracks with ground truth: ID switches, coverage and position errors of each person.

In each image, people and tracks within `GATE_M` in the horizontal plane are matched as in TrackEval's CLEAR metric
(Bernardin and Stiefelhagen 2008): matches of the previous image are kept, then as many others as possible are added
with the least sum of distances. TrackEval itself is not required, because it need not be installed on a robot. An ID
switch is a match with a track other than the last one. Only people and tracks with the status VISIBLE are matched. A
person who is not matched, such as behind another one, is tracked as long as the last track is published nearby.
"""
from typing import List, NamedTuple

import numpy as np

from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.tracking.types import VISIBLE, TrackedObject
from ros_3d_bb_lab.evaluation.matching import assign, plane_distances

GATE_M = 1.0
KEPT = 1000  # score of a kept match; other matches have 0.5 at the gate to 1 at distance 0, as in TrackEval
LONGEST_GAP = 1.5  # in image periods of a camera; a longer gap ends a visible interval


class Moment(NamedTuple):
    """Stamp of an image, its ground truth, and the tracks after it, in the same fixed frame."""

    stamp_ns: int
    truth: List[TrackedObject]
    tracks: List[TrackedObject]


class PersonScore(NamedTuple):
    """Tracking scores of one person.

    `visible_s` is the total time in view; `detected` and `tracked` are the shares 0..1 of the images with the person
    visible that have a matched track, and that have the last one within `GATE_M`, whatever its status; `ids` has an
    entry for each change of the track ID; `rmse_m` and `worst_m` are position errors of the matched tracks, NaN if
    there are none.
    """

    person: int
    visible_s: float
    detected: float
    tracked: float
    ids: List[int]
    rmse_m: float
    worst_m: float

    @property
    def switches(self):
        return max(0, len(self.ids) - 1)


class SceneScore(NamedTuple):
    """Tracking scores of a scene; `false_share` is the number of visible false tracks per image."""

    people: List[PersonScore]
    images: int
    false_share: float


def score(moments, cameras=1):
    """Compare tracks with ground truth. Takes a list of Moment ordered by stamp, returns a SceneScore.

    `cameras` is the number of cameras that take turns in the moments.
    """
    matches, false, matcher = [], 0, ClearMatcher()
    for moment in moments:
        visible = [track for track in moment.tracks if track.status == VISIBLE]
        matches.append(matcher.match(moment.truth, visible))
        false += len(visible) - len(matches[-1])
    people = sorted(set(person.id for moment in moments for person in moment.truth))
    return SceneScore([_person_score(person, moments, matches, cameras) for person in people], len(moments),
                      false / float(max(1, len(moments))))


class ClearMatcher(object):
    """Matches people with tracks image by image, at distances of at most `gate_m`."""

    def __init__(self, gate_m=GATE_M):
        self._gate_m, self._last_matches = gate_m, {}

    def match(self, people, tracks):
        """Match one image. Returns pairs (person, track): kept matches first, then the others by distance."""
        if not people or not tracks:
            return []
        distances_m = plane_distances([person.position_m for person in people], [track.position_m for track in tracks])
        near = distances_m <= self._gate_m
        kept = np.array([[self._last_matches.get(person.id) == track.id for track in tracks] for person in people])
        scores = np.where(near, KEPT * kept + 1 - distances_m / (2 * self._gate_m), 0)
        matches = sorted((match for match in zip(*assign(-scores)) if near[match]), key=lambda match: -scores[match])
        pairs = [(people[row], tracks[column]) for row, column in matches]
        self._last_matches = {person.id: track.id for person, track in pairs}
        return pairs


def _person_score(person_id, moments, matches, cameras):
    ids, errors_m, visible_ns, tracked = [], [], [], 0
    for moment, pairs in zip(moments, matches):
        visible = [person for person in moment.truth if person.id == person_id and person.status == VISIBLE]
        if not visible:
            continue
        visible_ns.append(moment.stamp_ns)
        for person, track in pairs:
            if person.id == person_id:
                errors_m.append(distance_m(track.position_m, person.position_m))
                if ids[-1:] != [track.id]:
                    ids.append(track.id)
        tracked += any(track.id in ids[-1:] and distance_m(track.position_m, visible[0].position_m) <= GATE_M
                       for track in moment.tracks)
    visible_s = _visible_s(visible_ns, [moment.stamp_ns for moment in moments], cameras)
    images = float(max(1, len(visible_ns)))
    return PersonScore(person_id, visible_s, len(errors_m) / images, tracked / images, ids,
                       float(np.sqrt(np.mean(np.square(errors_m)))) if errors_m else float('nan'),
                       max(errors_m, default=float('nan')))


def distance_m(one, other):
    return float(np.hypot(*(np.asarray(one) - other)[:2]))


def _visible_s(visible_ns, all_ns, cameras):
    period_ns = cameras * np.median(np.diff(all_ns)) if len(all_ns) > 1 else 0
    gaps_ns = np.diff(visible_ns)
    return float(np.sum(gaps_ns[gaps_ns <= LONGEST_GAP * period_ns])) / NS


def table_of_people(scene_score):
    """Format the scores as a table of text: a header and rows, and a sentence on all images."""
    rows = [('%d' % person.person, '%.1f s' % person.visible_s, '%.0f %%' % (100 * person.detected),
             '%.0f %%' % (100 * person.tracked), '%d' % person.switches, ' '.join(map(str, person.ids)) or '-',
             '%.3f m' % person.rmse_m, '%.3f m' % person.worst_m) for person in scene_score.people]
    return (('person', 'visible', 'detected', 'tracked', 'ID switches', 'track IDs', 'RMSE', 'worst'), rows,
            '%d images, %.3f false tracks per image' % (scene_score.images, scene_score.false_share))
