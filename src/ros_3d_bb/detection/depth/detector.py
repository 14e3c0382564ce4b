"""Detect people in an aligned depth image and a colour image, without a neural network.

Points above the floor are clustered. A cluster of human size is classified as a person by its shape in depth and by
OpenCV's HOG people detector.
"""
import itertools
import math
from typing import NamedTuple, Tuple

import numpy as np

from ros_3d_bb.detection.boxes import Detections
from ros_3d_bb.detection.depth.ground_plane import FAR_M, FittedFloor, KnownFloor, check_upright, is_confirmed
from ros_3d_bb.detection.depth.person_classifier import (BEST_HOG, LOW_SCORE, PersonHog, PersonWindow, Pyramid,
                                                         person_score, shape_features_of)
from ros_3d_bb.detection.depth.person_clusters import (DepthPeopleParams, find_person_clusters, grid_of, is_human,
                                                       is_standing, quantile_of)

MEAN_HEIGHT_M, MEAN_WIDTH_M = 1.7, 0.5  # assumed for people who are partly outside the image
SURE_SCORE = 0.9  # no further HOG scores are evaluated from this score on
# A cluster that has hardly moved keeps its score for some images: scores take most of the time, and change slowly.
MAX_SCORE_AGE, MOVED_M = 2, 0.1
# Hysteresis, as of the thresholds of Canny (1986): a person who was sure in so many images continues with a lower
# score, as one who crouches or is partly hidden, for a number of images. An image without the person counts as several
# unless someone else hides the person. Chosen: furniture has lower scores or is seldom sure; 75 images are 5 s of the
# demo.
LEAST_SURE, CONTINUED_SCORE, MAX_UNSURE, NOT_FOUND = 3, 0.1, 75, 15
# Legs alone, as a robot with a low camera sees of a person that it has driven up to, are never sure. Chosen: simulated
# ones score 0.03 or more, walls and cupboards 0.01.
LEGS_SCORE = 0.02
NEARER_M, HIDDEN_SHARE = 0.3, 0.5  # of a person who hides the legs of another one, and of the width of these; chosen
FLOOR_STEP = 3  # every n-th cell of the grid confirms the floor
MIN_DISTANCE_M = 0.35  # between the centres of two people; closer detections are one person


class DepthDetection(NamedTuple):
    """A detected person: box (x1, y1, x2, y2), score 0..1, and position to the right and ahead of the camera.

    The person was sure in `sure` images, most recently `unsure` images ago, with the height `height_m`.
    """

    box: Tuple[float, float, float, float]
    score: float
    position_m: Tuple[float, float]
    sure: int
    unsure: int
    height_m: float


class DepthPeople(object):
    """Detector of people in depth and colour images.

    Raises ValueError if two parameters contradict each other, or this OpenCV has no HOG detector.
    """

    def __init__(self, params=DepthPeopleParams()):
        self.reconfigure(params)
        self._hog, self._fitted_floor, self._known_floor = PersonHog(), FittedFloor(), KnownFloor()
        self._last_people = []  # DepthDetections in the last image, and those lost since
        self._scores = []  # position, score and age in images, of the clusters in the last image

    def reconfigure(self, params):
        """Change the DepthPeopleParams. If two contradict each other, raise ValueError and keep the old ones."""
        for name in ('depth', 'camera_height'):
            low, high = getattr(params, 'min_%s' % name), getattr(params, 'max_%s' % name)
            if not low < high:
                raise ValueError('min_%s is %g and max_%s is %g; min_%s must be smaller'
                                 % (name, low, name, high, name))
        self._params = params

    def detect(self, image, depth, camera, floor=None):
        """Detect people in an RGB image (height, width, 3), uint8, and the DepthImage aligned to it.

        By default, the floor (ground_plane.Floor) is fitted to this image; if that fails, the last fitted floor is
        used, unless a floor was given since. Returns Detections of class 0, or None if no floor is known yet. Raises
        ValueError if the images or the camera differ in size, or the camera is not upright above the floor.
        """
        if depth.shape != (camera.height, camera.width):
            raise ValueError('the depth image has %d x %d pixels and the colour camera %d x %d; depth aligned to '
                             'colour expected' % (depth.shape[::-1] + camera[:2]))
        if image.shape[:2] != depth.shape:
            raise ValueError('the colour image has %d x %d pixels and the depth image %d x %d; depth aligned to colour '
                             'expected' % (image.shape[1::-1] + depth.shape[::-1]))
        if floor is not None:
            self._fitted_floor = FittedFloor()
        else:
            self._known_floor = KnownFloor()
        grid = self._grid_of(depth, camera, floor)
        if grid is None:
            return None
        floor, pyramid = self.floor, Pyramid(image)
        people, scores = [], []
        for blob, shape in find_person_clusters(grid, camera, self._params):
            box = box_of(blob, shape, grid, camera, floor)
            position_m = camera.rays((box[0] + box[2]) / 2.0, camera.cy)[0] * shape.depth_m, shape.depth_m
            last, stands = self._last_at(position_m), is_standing(shape, self._params)
            may_continue = last is not None and last.sure >= LEAST_SURE and last.unsure < MAX_UNSURE
            if not stands and not may_continue:
                continue
            score, age = self._recent_score(position_m)
            if age > MAX_SCORE_AGE:
                window = person_window_of(blob, shape, grid, camera, floor)
                score, age = self._score_of(blob, shape, grid, pyramid, window), 0
            scores.append((position_m, score, age))
            if score >= self._params.min_score and stands:
                sure, height_m = last.sure + 1 if last else 1, MEAN_HEIGHT_M if shape.cut_top else shape.top_m
                people.append(DepthDetection(box, score, position_m, sure, 0, height_m))
            elif may_continue and score >= (LEGS_SCORE if shape.cut_top else CONTINUED_SCORE):
                if not is_human(shape):
                    box, position_m = _completed_part(box, shape, last, camera, floor)
                people.append(last._replace(box=box, score=score, position_m=position_m,
                                            unsure=last.unsure + (not shape.cut_top)))
        people, self._scores = _without_repeated(people), scores
        self._last_people = people + self._lost(people)
        return _merged_detections([_completed(person, people, camera, floor) for person in people])

    def _grid_of(self, depth, camera, known):
        """Grid of the image, and its Floor as `self.floor`; None if no floor is known."""
        if known is None:
            self.floor = self._fitted_floor.update(depth, camera, self._params)
            return None if self.floor is None else grid_of(depth, camera, self.floor, self._params)
        check_upright(known)
        self.floor = self._known_floor.of(known)
        grid = grid_of(depth, camera, self.floor, self._params)
        depth_m, height_m = (values[::FLOOR_STEP, ::FLOOR_STEP] for values in (grid.depth_m, grid.height_m))
        valid = (depth_m > 0) & (depth_m < FAR_M)
        if not is_confirmed(height_m[valid], depth_m[valid], self.floor):
            last, self.floor = self.floor, self._known_floor.correct(known, depth, camera, self._params)
            if self.floor is not last:
                grid = grid_of(depth, camera, self.floor, self._params)
        return grid

    def _last_at(self, position_m):
        return next((person for person in self._last_people
                     if _distance_m(person.position_m, position_m) < MIN_DISTANCE_M), None)

    def _lost(self, people):
        """The people of the last image who are not found again, and may be in the next one."""
        lost = []
        for person in self._last_people:
            is_hidden = any(_hidden_share(person, other) for other in people)
            unsure = person.unsure + (1 if is_hidden else NOT_FOUND)
            if unsure < MAX_UNSURE and not _is_beside(person, people):
                lost.append(person._replace(unsure=unsure))
        return lost

    def _recent_score(self, position_m):
        """The score of a cluster in an earlier image, and its age in images."""
        return next(((score, age + 1) for place_m, score, age in self._scores
                     if _distance_m(place_m, position_m) < MOVED_M), (0.0, MAX_SCORE_AGE + 1))

    def _score_of(self, blob, shape, grid, pyramid, window):
        """Score of a cluster: HOG is evaluated only where it decides."""
        features, score = shape_features_of(blob, shape, grid), 0.0
        if person_score(features, BEST_HOG, shape.cut_top) < self._params.min_score:
            return score  # rejected by its shape alone
        for hog in itertools.chain([LOW_SCORE], self._hog.scores(pyramid, window)):
            score = person_score(features, hog, shape.cut_top)
            if score >= SURE_SCORE:
                break
        return score


def person_window_of(blob, shape, grid, camera, floor):
    """Image region of the whole person whose visible part is the blob. Returns PersonWindow."""
    left, right = blob.column * grid.step, (blob.column + blob.mask.shape[1]) * grid.step
    middle = (left + right) / 2.0
    half = MEAN_WIDTH_M / 2 * camera.fx / shape.depth_m
    if shape.cut_side:
        middle = min(middle, right - half) if blob.column == 0 else max(middle, left + half)
    soles = floor.row(camera, middle, shape.depth_m)
    height_m = shape.top_m if not shape.cut_top and shape.top_m > 1.4 else MEAN_HEIGHT_M
    return PersonWindow(middle, soles - height_m * camera.fy / shape.depth_m, soles)


def box_of(blob, shape, grid, camera, floor):
    """Box (x1, y1, x2, y2) of the visible part of a person.

    Visible feet lie within the floor margin, outside the blob. The box of a person visible nearly to the ground is
    therefore extended to the floor.
    """
    rows, columns = blob.mask.shape
    x1, y1, x2, y2 = (edge * grid.step for edge in (blob.column, blob.row, blob.column + columns, blob.row + rows))
    if shape.bottom_m < 0.4:
        lowest_m = quantile_of(blob.window(grid.depth_m)[-3:][blob.mask[-3:]], 0.5)
        y2 = max(y2, floor.row(camera, (x1 + x2) / 2.0, lowest_m))
    return x1, y1, min(x2, camera.width), min(y2, camera.height)


def _completed_part(box, shape, last, camera, floor):
    """Box and position of a person of whom only a part is visible.

    The height is that of the last DepthDetection, and so is the place across the view, from which the part is at most
    half the usual width away. Where the image border cuts the part, the rest may be too near for the depth camera: the
    box then has the usual width.
    """
    half_m, depth_m = MEAN_WIDTH_M / 2, shape.depth_m
    left_m, right_m = camera.rays(np.array(box[::2]), camera.cy)[0] * depth_m
    across_m = min(max(last.position_m[0], right_m - half_m), left_m + half_m)
    x1, y1, x2, y2 = _extended(box, last.height_m, depth_m, camera, floor)
    if shape.cut_side:
        middle, half = camera.cx + across_m * camera.fx / depth_m, half_m * camera.fx / depth_m
        x1, x2 = max(min(x1, middle - half), 0), min(max(x2, middle + half), camera.width)
    return (x1, y1, x2, y2), (across_m, depth_m)


def _completed(person, people, camera, floor):
    """Return a DepthDetection whose box ends at the floor if another of the people hides the legs.

    The tracker compares heights: a box of the upper body alone would be that of a smaller person.
    """
    if not any(_hides_legs(other, person) for other in people):
        return person
    return person._replace(box=_extended(person.box, 0, person.position_m[1], camera, floor))


def _extended(box, height_m, depth_m, camera, floor):
    """Extend the box of a part of a person to the floor, and to a height above it."""
    x1, y1, x2, y2 = box
    soles = floor.row(camera, (x1 + x2) / 2.0, depth_m)
    crown = soles - height_m * camera.fy / depth_m
    return x1, max(min(y1, crown), 0), x2, min(max(y2, soles), camera.height)


def _hides_legs(other, person):
    return other.box[1] < person.box[3] < other.box[3] and _hidden_share(person, other) > HIDDEN_SHARE


def _hidden_share(person, other):
    if other.position_m[1] >= person.position_m[1] - NEARER_M:
        return 0.0
    (x1, x2), (left, right) = person.box[::2], other.box[::2]
    return max(min(x2, right) - max(x1, left), 0) / (x2 - x1)


def _distance_m(one_m, other_m):
    return math.hypot(one_m[0] - other_m[0], one_m[1] - other_m[1])


def _without_repeated(people):
    """The DepthDetections without what is beside a sure one and may continue the same person, such as a chair."""
    sure = [person for person in people if not person.unsure]
    return [person for person in people if not person.unsure or not _is_beside(person, sure)]


def _is_beside(person, others):
    return any(_distance_m(person.position_m, other.position_m) < 2 * MIN_DISTANCE_M for other in others)


def _merged_detections(people):
    """Merge parts of one person, closer together than MIN_DISTANCE_M, and convert DepthDetections to Detections.

    The position of the largest part is kept, as it is more accurate.
    """
    merged = []
    for part in sorted(people, key=lambda person: -np.subtract(person.box[2:], person.box[:2]).prod()):
        for index, person in enumerate(merged):
            if _distance_m(person.position_m, part.position_m) < MIN_DISTANCE_M:
                box = np.hstack((np.minimum(person.box[:2], part.box[:2]), np.maximum(person.box[2:], part.box[2:])))
                merged[index] = person._replace(box=box, score=max(person.score, part.score))
                break
        else:
            merged.append(part)
    merged.sort(key=lambda person: -person.score)
    return Detections(np.array([person.box for person in merged], float).reshape(-1, 4),
                      np.array([person.score for person in merged], float), np.zeros(len(merged), int))
