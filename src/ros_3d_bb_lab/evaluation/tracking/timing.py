"""CPU time of a tracker update by the number of people in view."""
import time

import numpy as np

from ros_3d_bb.core.time_sync import NS
from ros_3d_bb_lab.evaluation.tracking.d435_model import CameraModel
from ros_3d_bb_lab.evaluation.tracking.detection_generator import SimulatedDetection
from ros_3d_bb_lab.evaluation.tracking.run_generator import detection_of, view_of

PEOPLE = (5, 20, 100)
AREA_M2 = 1.0  # per person
CIRCLE_M, TURNS_HZ = 0.3, 0.3  # each person walks in a circle around a fixed place
WARM_UP, MEASURED, RATE_HZ = 15, 45, 30
SIZE_M = (0.5, 1.7)


def cpu_ms(make_tracker, people):
    """Median CPU time of an update, in milliseconds, with `people` people that are detected in every image."""
    tracker, spent_s = make_tracker(), []
    for stamp_ns, detections, view in crowd(people, WARM_UP + MEASURED):
        begin_s = time.process_time()
        tracker.update(stamp_ns, detections, view)
        spent_s.append(time.process_time() - begin_s)
    return 1e3 * float(np.median(spent_s[WARM_UP:]))


def crowd(people, images):
    """Yield images (stamp_ns, detections, view) of a crowd in the field of view.

    The area of the crowd grows with the number of people.
    """
    random, camera = np.random.RandomState(people), CameraModel()
    view = view_of(np.zeros(3), camera)
    farthest_m = np.sqrt(2 * people * AREA_M2 / camera.field_of_view + 1)
    range_m = np.sqrt(random.uniform(1, farthest_m ** 2, people))
    bearing = random.uniform(-0.45, 0.45, people) * camera.field_of_view
    phase = random.uniform(0, 2 * np.pi, people)
    for number in range(images):
        angle = phase + 2 * np.pi * TURNS_HZ * number / RATE_HZ
        depth_m = range_m * np.cos(bearing) + CIRCLE_M * np.cos(angle)
        left_m = range_m * np.sin(bearing) + CIRCLE_M * np.sin(angle)
        depth_m += random.normal(size=people) * camera.depth_sigma_m(depth_m)
        left_m += random.normal(size=people) * camera.side_floor_m
        found = [SimulatedDetection(np.arctan2(left_m[row], depth_m[row]), depth_m[row], SIZE_M[0], SIZE_M[1], False,
                                    row)
                 for row in range(people)]
        yield (number + 1) * NS // RATE_HZ, [detection_of(box, view, camera) for box in found], view
