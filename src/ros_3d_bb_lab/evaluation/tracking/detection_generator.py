"""Simulated output of a detector and bbox3d_node: 3D boxes with errors, misses, false detections and duplicates."""
from typing import NamedTuple

import numpy as np

from ros_3d_bb_lab.evaluation.tracking.d435_model import BODY_RADIUS_M, thesis_bias_m
from ros_3d_bb_lab.evaluation.tracking.robot_motion import bearing_of, from_frame, to_frame

HARD_TO_SEE, EASY_TO_SEE = 0.3, 0.6  # visible share: no detection below the first, no occlusion misses from the second
FOUND_WHEN_HARD = 0.4
BEYOND_M = 0.2  # people are detected up to this distance beyond `farthest_m`
STEP_HZ, WALKING_MPS = 0.95, 0.8  # frequency of a gait cycle, and the speed of full body sway
SIDE_DOUBLE_M, DEEP_DOUBLE_M, DOUBLE_WIDTH_M = 0.12, 0.1, 0.4
FALSE_RANGE_M, FALSE_HEIGHT_M, FALSE_WIDTH_M = (1.0, 6.0), (0.8, 1.9), (0.2, 0.6)
FALSE_SIDE_M, FALSE_DEPTH_M = 0.02, 0.04


class SimulatedDetection(NamedTuple):
    """3D box; `cut` is whether the image border truncates it."""

    bearing: float
    depth_m: float
    width_m: float
    height_m: float
    cut: bool


class DetectablePerson(NamedTuple):
    """Person in an image; `share`, `middle`, `cut` as in `d435_model.shown`; `heading` is relative to the camera."""

    person: int
    depth_m: float
    range_m: float
    middle: float
    share: float
    cut: bool
    speed_mps: float
    heading: float


class Detector(object):
    """Detector of people (0 .. people - 1) in images every `period_s`, with errors correlated between images."""

    def __init__(self, camera, people, period_s, random):
        self._camera, self._period_s, self._random = camera, period_s, random
        self._height_m = np.clip(random.normal(1.70, 0.09, people), 1.45, 2.0)
        self._phase = random.uniform(0, 2 * np.pi, people)
        self._slow = random.normal(size=(2, people))
        self._missed = random.uniform(size=people) < camera.miss_share
        self._outlier = np.zeros(people, bool)
        self._false_m = np.zeros((0, 2))

    def advance(self, pose):
        """Advance to the next image, taken at the true camera pose `pose`. To be called for lost images, too."""
        camera, random = self._camera, self._random
        kept = np.exp(-self._period_s / camera.slow_s)
        self._slow = kept * self._slow + np.sqrt(1 - kept ** 2) * random.normal(size=self._slow.shape)
        self._missed = self._switched(self._missed, camera.miss_share, camera.miss_s)
        self._outlier = self._switched(self._outlier, camera.outlier_share, camera.outlier_s)
        ends = -np.expm1(-self._period_s / camera.false_s)
        self._false_m = self._false_m[random.uniform(size=len(self._false_m)) >= ends]
        if random.uniform() < camera.false_rate:
            bearing, range_m = random.uniform(-0.5, 0.5) * camera.field_of_view, random.uniform(*FALSE_RANGE_M)
            place_m = from_frame(pose, range_m * np.array([np.cos(bearing), np.sin(bearing)]))
            self._false_m = np.concatenate((self._false_m, [place_m]))

    def find(self, seen, pose, time_s):
        """Detect people in the current image.

        `seen` is a list of DetectablePerson and `pose` (3,) the true camera pose. Returns a list of SimulatedDetection
        in random order.
        """
        found = []
        for person in seen:
            if self._is_found(person):
                found.append(self._found(person, time_s))
                if self._random.uniform() < self._camera.double_share:
                    found.append(self._double(found[-1], person.person))
        found += self._false(pose)
        return [found[number] for number in self._random.permutation(len(found))]

    def _switched(self, on, share, stretch_s):
        """Next state of a Markov chain that is on for a `share` of the time, for `stretch_s` on average."""
        ends = -np.expm1(-self._period_s / stretch_s)
        drawn = self._random.uniform(size=len(on))
        return np.where(on, drawn > ends, drawn < ends * share / (1 - share))

    def _is_found(self, person):
        camera = self._camera
        if (person.share < HARD_TO_SEE or person.depth_m < camera.nearest_m
                or person.range_m > camera.farthest_m + BEYOND_M or self._missed[person.person]):
            return False
        ease = min(1.0, (person.share - HARD_TO_SEE) / (EASY_TO_SEE - HARD_TO_SEE))
        return self._random.uniform() <= FOUND_WHEN_HARD + (1 - FOUND_WHEN_HARD) * ease

    def _found(self, seen, time_s):
        camera, random, person = self._camera, self._random, seen.person
        sway_m = (camera.sway_m * np.sin(2 * np.pi * STEP_HZ * time_s + self._phase[person])
                  * min(1.0, seen.speed_mps / WALKING_MPS))
        depth_m = seen.depth_m - sway_m * np.sin(seen.heading)
        depth_m += (camera.bias_left * thesis_bias_m(depth_m) + camera.slow_depth_m * self._slow[0, person]
                    + random.normal(0, camera.depth_sigma_m(seen.depth_m)))
        if self._outlier[person]:
            depth_m += random.uniform(*camera.outlier_m)
        side_m = (sway_m * np.cos(seen.heading) + camera.slow_side_m * self._slow[1, person]
                  + random.normal(0, camera.side_floor_m))
        width_m = 2 * BODY_RADIUS_M * seen.share * np.clip(random.normal(1, 0.15), 0.5, 1.6)
        height_m = self._height_m[person] + random.normal(0, 0.05)
        return SimulatedDetection(seen.middle + side_m / seen.range_m, depth_m, width_m, height_m, seen.cut)

    def _double(self, box, person):
        random = self._random
        depth_m = box.depth_m + abs(random.normal(0, DEEP_DOUBLE_M))
        side_m = box.depth_m * np.tan(box.bearing) + random.normal(0, SIDE_DOUBLE_M)
        return SimulatedDetection(np.arctan2(side_m, depth_m), depth_m, DOUBLE_WIDTH_M,
                                  self._height_m[person] * random.uniform(0.6, 1), box.cut)

    def _false(self, pose):
        random, found = self._random, []
        for forward_m, left_m in to_frame(pose, self._false_m):
            if forward_m > 0 and abs(np.arctan2(left_m, forward_m)) < self._camera.field_of_view / 2:
                point_m = np.array([forward_m, left_m]) + random.normal(0, (FALSE_DEPTH_M, FALSE_SIDE_M))
                found.append(SimulatedDetection(bearing_of(point_m), point_m[0], random.uniform(*FALSE_WIDTH_M),
                                                random.uniform(*FALSE_HEIGHT_M), False))
        return found
