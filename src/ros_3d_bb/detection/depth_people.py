"""Find people in an aligned depth image and a colour image, without a trained network of our own.

What stands above the floor falls into blobs; a blob of human size is a person if its shape in depth and OpenCV's HOG
people detector together say so.
"""
from typing import NamedTuple, Tuple

import numpy as np

from ros_3d_bb.detection.bodies import DepthPeopleParams, check_params, find_bodies, grid_of
from ros_3d_bb.detection.boxes import Detections
from ros_3d_bb.detection.floor import check_upright, fit_floor
from ros_3d_bb.detection.hog import BEST_HOG, Figure, PersonHog, evidence_of, person_score, pyramid_of

MEAN_HEIGHT_M, MEAN_WIDTH_M = 1.7, 0.5  # of a person who is partly outside the image
CLOSEST_M = 0.35  # the middles of two people are farther apart


class Found(NamedTuple):
    """A person: box (x1, y1, x2, y2), score 0..1, and where they are to the right and ahead of the camera."""

    box: Tuple[float, float, float, float]
    score: float
    x_m: float
    depth_m: float


class DepthPeople(object):
    """A detector of people in depth and colour.

    Parameters
    ----------
    params : DepthPeopleParams

    Raises
    ------
    ValueError
        If a parameter makes no sense, or this OpenCV has no HOG detector.
    """

    def __init__(self, params=DepthPeopleParams()):
        self.tune(params)
        self._hog, self._floor = PersonHog(), None

    def tune(self, params):
        """Search the next images with other parameters. Raises ValueError as at the start, and changes nothing."""
        check_params(params)
        self._params = params

    def detect(self, image, depth, camera, floor=None):
        """Find people.

        Parameters
        ----------
        image : numpy.ndarray, (height, width, 3), uint8, RGB
        depth : ros_3d_bb.estimation.DepthImage
            Aligned to the colour image.
        camera : ros_3d_bb.geometry.Camera
        floor : ros_3d_bb.detection.floor.Floor, optional
            Where not given, fitted to this image; where that fails, the last one that was.

        Returns
        -------
        ros_3d_bb.detection.boxes.Detections or None
            All of class 0. None while no floor was found yet: nobody knows who is there.

        Raises
        ------
        ValueError
            If the images or the camera differ in size, or the camera does not stand upright above the floor.
        """
        if depth.values.shape != (camera.height, camera.width):
            raise ValueError('depth image has %d x %d pixels and the colour camera %d x %d; depth aligned to colour '
                             'expected' % (depth.values.shape[::-1] + camera[:2]))
        if image.shape[:2] != depth.values.shape:
            raise ValueError('colour image has %d x %d pixels and depth image %d x %d; depth aligned to colour expected'
                             % (image.shape[1::-1] + depth.values.shape[::-1]))
        if floor is None:
            floor = self._floor = fit_floor(depth, camera) or self._floor
        if floor is None:
            return None
        check_upright(floor)
        grid = grid_of(depth, camera, floor, self._params)
        pyramid = pyramid_of(image)
        found = []
        for blob, shape in find_bodies(grid, camera, self._params):
            evidence = evidence_of(blob.mask, blob.window(grid.ahead_m), shape.thickness_m)
            if person_score(evidence, BEST_HOG, shape.cut_top) < self._params.min_score:
                continue  # furniture by its shape alone: no need to look
            hog = self._hog.score(pyramid, figure_of(blob, shape, grid, camera, floor))
            score = person_score(evidence, hog, shape.cut_top)
            if score >= self._params.min_score:
                box = box_of(blob, shape, grid, camera, floor)
                x_m = ((box[0] + box[2]) / 2.0 - camera.cx) / camera.fx * shape.depth_m
                found.append(Found(box, score, x_m, shape.depth_m))
        return _detections(found)


def figure_of(blob, shape, grid, camera, floor):
    """Where the whole person would be in the image whose visible part is the blob. Returns Figure."""
    left, right = blob.column * grid.step, (blob.column + blob.mask.shape[1]) * grid.step
    middle = (left + right) / 2.0
    half = MEAN_WIDTH_M / 2 * camera.fx / shape.depth_m
    if shape.cut_side:
        middle = min(middle, right - half) if blob.column == 0 else max(middle, left + half)
    soles = floor.row(camera, middle, shape.depth_m)
    height_m = shape.top_m if not shape.cut_top and shape.top_m > 1.4 else MEAN_HEIGHT_M
    return Figure(middle, soles - height_m * camera.fy / shape.depth_m, soles)


def box_of(blob, shape, grid, camera, floor):
    """The rectangle of a person's visible part, down to the floor: its margin took away the feet. (x1, y1, x2, y2)."""
    rows, columns = blob.mask.shape
    x1, y1, x2, y2 = (edge * grid.step for edge in (blob.column, blob.row, blob.column + columns, blob.row + rows))
    if shape.bottom_m < 0.4:
        lowest_m = np.median(blob.window(grid.depth_m)[-3:][blob.mask[-3:]])
        y2 = max(y2, floor.row(camera, (x1 + x2) / 2.0, lowest_m))
    return x1, y1, min(x2, camera.width), min(y2, camera.height)


def _detections(found):
    """Detections of a list of Found, best first; what stands closer together than two people can is one of them."""
    people = []
    for entry in sorted(found, key=lambda entry: -_area(entry.box)):
        near = [number for number, other in enumerate(people) if _distance_m(entry, other) < CLOSEST_M]
        if near:
            people[near[0]] = _united(people[near[0]], entry)
        else:
            people.append(entry)
    people.sort(key=lambda entry: -entry.score)
    return Detections(np.array([entry.box for entry in people], float).reshape(-1, 4),
                      np.array([entry.score for entry in people], float), np.zeros(len(people), int))


def _area(box):
    return (box[2] - box[0]) * (box[3] - box[1])


def _distance_m(one, other):
    return float(np.hypot(one.x_m - other.x_m, one.depth_m - other.depth_m))


def _united(large, small):
    """One person of whom two parts were found; the larger one knows better where they are."""
    low, high = np.minimum(large.box, small.box)[:2], np.maximum(large.box, small.box)[2:]
    return large._replace(box=tuple(low) + tuple(high), score=max(large.score, small.score))
