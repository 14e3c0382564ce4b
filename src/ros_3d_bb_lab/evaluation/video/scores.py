"""Scores of boxes and tracks on a video, compared with the people that are annotated in its images.

People are scored if at least half of the body is visible. A box shows a person if their intersection over union is at
least one half; each person has at most one box. A box that shows no person is false, unless at least half of it lies on
a person that is not scored. Tracks with the status VISIBLE have the box of their detection, and are compared with
people in the same way. One of them is false only if it is not on a person at all: if its box contains less than half of
the visible part of each person. A box that is too large, or of a part of a person, is an error of the box.
"""
from typing import Any, NamedTuple

import numpy as np

from ros_3d_bb.camera.camera_model import transform_points
from ros_3d_bb.detection.boxes import iou
from ros_3d_bb.tracking.types import VISIBLE
from ros_3d_bb_lab.evaluation.matching import assign
from ros_3d_bb_lab.evaluation.tracking.metrics import trackeval_results

FOUND_IOU, LEAST_VISIBLE, ON_UNSCORED, ON_PERSON = 0.5, 0.5, 0.5, 0.5
NEAREST_M = 0.1  # nearer points are not projected


class Step(NamedTuple):
    """One image after the pipeline: its name, all 2D boxes (n, 4), `rects`, those of the 3D boxes by
    `types.Detection.index`, and the tracks of each tracker, lists of TrackedObject by its name."""

    name: str
    boxes: np.ndarray
    rects: Any
    tracks: dict


class Pairs(NamedTuple):
    """Rectangles of one image compared with people: `found` are (person, number of the rectangle), `scored` masks (n,)
    the rectangles that are false if they show no person, and `people` are the scored ones."""

    people: list
    found: list
    scored: np.ndarray
    overlaps: np.ndarray  # (people, n), intersection over union
    empty: np.ndarray  # mask (n,) of the rectangles that are on no person, scored or not

    @property
    def false(self):
        return int(self.scored.sum()) - len(self.found)


def compare(people, rects):
    """The Pairs of a list of `recording.Person` and rectangles (n, 4)."""
    rects = np.reshape(rects, (-1, 4))
    scored_people = [person for person in people if person.visible >= LEAST_VISIBLE]
    overlaps = np.reshape([iou(person.rect_px, rects) for person in scored_people], (len(scored_people), len(rects)))
    pairs = list(zip(*assign(np.where(overlaps >= FOUND_IOU, -overlaps, np.inf))))
    is_scored = np.ones(len(rects), bool)
    for person in people:
        if person.visible < LEAST_VISIBLE:
            is_scored &= _shares_on(person.rect_px, rects) < ON_UNSCORED
    is_scored[[column for _row, column in pairs]] = True
    is_empty = np.ones(len(rects), bool)
    for person in people:
        area = np.subtract(person.rect_px[2:], person.rect_px[:2]).prod()
        is_empty &= _common_areas(person.rect_px, rects) < ON_PERSON * area
    is_empty[[column for _row, column in pairs]] = False
    return Pairs(scored_people, [(scored_people[row], int(column)) for row, column in pairs], is_scored, overlaps,
                 is_empty)


def _common_areas(rect, rects):
    sides = np.minimum(rects[:, 2:], rect[2:]) - np.maximum(rects[:, :2], rect[:2])
    return np.clip(sides, 0, None).prod(axis=1)


def _shares_on(rect, rects):
    return _common_areas(rect, rects) / np.maximum((rects[:, 2:] - rects[:, :2]).prod(axis=1), 1)


def score_boxes(steps, truth):
    """Recall and precision of the 2D boxes, shares 0..1, and the number of `images` that are scored."""
    pairs = [compare(truth.frames[step.name], step.boxes) for step in steps if step.name in truth.frames]
    people, found, false = (sum(counts) for counts in zip(*[(len(p.people), len(p.found), p.false) for p in pairs]))
    return {'recall': found / people if people else None, 'precision': found / (found + false) if found else None,
            'images': len(pairs), 'people': people}


def score_tracks(steps, truth, tracker, view):
    """Scores of the tracks of a tracker: see doc/benchmark_methods.md. HOTA and IDF1 are in percent."""
    people_ids, track_ids, overlaps, false, published = [], [], [], 0, 0
    people = {}
    for step in steps:
        if step.name not in truth.frames:
            continue
        tracks = visible_tracks(step, tracker)
        pairs = compare(truth.frames[step.name], [step.rects[track.detection] for track in tracks])
        people_ids.append(np.array([person.id for person in pairs.people], int))
        track_ids.append(np.array([track.id for track in tracks], int)[pairs.scored])
        overlaps.append(pairs.overlaps[:, pairs.scored])
        false += int(pairs.empty.sum())
        shown = [(person, tracks[number]) for person, number in pairs.found]
        lost = [track for track in step.tracks[tracker] if track.status != VISIBLE]
        found_ids = set(person.id for person, _track in shown)
        published += len(found_ids) + sum(person.id not in found_ids and any(
            _is_on(person.rect_px, track, view) for track in lost) for person in pairs.people)
        for person, track in shown:
            people.setdefault(person.id, []).append(track)
    return dict(_identity_scores(people_ids, track_ids, overlaps),
                ids=len(set(track.id for tracks in people.values() for track in tracks)),
                false_tracks_per_image=false / len(people_ids),
                published=published / max(1, sum(map(len, people_ids))),
                people={str(number): _person(people[number]) for number in sorted(people)},
                **_steadiness(steps, tracker, set(track.id for tracks in people.values() for track in tracks), view))


def _identity_scores(people_ids, track_ids, overlaps):
    hota, clear, identity = trackeval_results(people_ids, track_ids, overlaps)
    return {'idf1': 100 * float(identity['IDF1']), 'hota': 100 * float(np.mean(hota['HOTA'])),
            'id_switches': int(clear['IDSW'])}


def _person(tracks):
    """The IDs of one person in the order of their first use, and the standard deviation of the height, metres."""
    ids = list(dict.fromkeys(track.id for track in tracks))
    return {'ids': ids, 'images': len(tracks), 'height_std_m': float(np.std([track.size_m[2] for track in tracks]))}


def visible_tracks(step, tracker):
    return [track for track in step.tracks[tracker] if track.status == VISIBLE and track.detection in step.rects]


def projected(track, view):
    """Rectangle (x1, y1, x2, y2) of a track in the image of a CameraView, pixels; None behind the camera."""
    ends = np.array(track.position_m) + np.outer((0.5, -0.5), (0, 0, track.size_m[2]))
    points = transform_points(np.linalg.inv(view.fixed_from_camera), ends)
    if points[:, 2].min() < NEAREST_M:
        return None
    (x_top, y1), (x_bottom, y2) = view.intrinsics.project(points)
    half_px = view.intrinsics.fx * track.size_m[0] / 2 / points[:, 2].mean()
    return (x_top + x_bottom) / 2 - half_px, y1, (x_top + x_bottom) / 2 + half_px, y2


def _is_on(rect, track, view):
    place = projected(track, view)
    if place is None:
        return False
    middle = (place[0] + place[2]) / 2, (place[1] + place[3]) / 2
    return rect[0] <= middle[0] <= rect[2] and rect[1] <= middle[1] <= rect[3]


def _steadiness(steps, tracker, ids, view):
    """How far tracks of people jump between two images, compared with the motion of their 2D boxes.

    The motion of a box, in metres, is that of a person of constant size: sideways by the shift of its middle, and along
    the ray by the change of its width or height, the smaller one, because the image border cuts one of them.
    """
    camera_m, jumps_m, moves_m = view.fixed_from_camera[:2, 3], [], []
    for before, after in zip(steps, steps[1:]):
        former = {track.id: track for track in visible_tracks(before, tracker) if track.id in ids}
        for track in visible_tracks(after, tracker):
            if track.id in former:
                other = former[track.id]
                distance_m = float(np.hypot(*other.position_m[:2] - camera_m))
                jumps_m.append(float(np.hypot(*(track.position_m - other.position_m)[:2])))
                moves_m.append(_motion_m(before.rects[other.detection], after.rects[track.detection], distance_m,
                                         view.intrinsics.fx))
    excess_m = np.array(jumps_m) - moves_m
    return {'jump_ratio': sum(jumps_m) / sum(moves_m) if sum(moves_m) else None,
            'jump_excess_p95_m': float(np.percentile(excess_m, 95)) if jumps_m else None}


def _motion_m(rect, other, distance_m, focal_px):
    rect, other = np.array(rect, float), np.array(other, float)
    sideways_m = distance_m * (rect[0::2].mean() - other[0::2].mean()) / focal_px
    ratios = np.log(np.maximum(rect[2:] - rect[:2], 1) / np.maximum(other[2:] - other[:2], 1))
    return float(np.hypot(sideways_m, distance_m * np.abs(ratios).min()))
