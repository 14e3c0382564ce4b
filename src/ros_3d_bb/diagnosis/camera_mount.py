"""Mount of a camera without tf, from its images: height, tilt and roll from the floor, quarter turns from people."""
from typing import NamedTuple, Optional

import numpy as np

from ros_3d_bb.camera.images import turned_camera, turned_depth, turned_image
from ros_3d_bb.detection.depth.detector import DepthPeople
from ros_3d_bb.detection.depth.ground_plane import CameraPose, camera_pose_above, fit_floor

IMAGES = 8  # that are used, of those given
FEW = 0.5  # people per image, below which the other rotations are tried
MIN_PEOPLE, TIMES_MORE = 4, 3  # that are found in rotated images, at least, and relative to the images as received


class CameraMount(NamedTuple):
    """Mount of a camera: number of people in the images by quarter turns, and pose; None if no floor is visible."""

    images: int
    people: dict
    turns: int
    pose: Optional[CameraPose] = None


def camera_mount(pairs, camera):
    """Return the CameraMount of a Camera, from pairs of an RGB image (h, w, 3) and aligned DepthImage of one time."""
    chosen = [pairs[number] for number in np.unique(np.linspace(0, len(pairs) - 1, IMAGES).astype(int))]
    people = {0: _people_in(chosen, camera, 0)}
    if people[0] < FEW * len(chosen):
        people.update({turns: _people_in(chosen, camera, turns) for turns in (1, 2, 3)})
    best = max(people, key=lambda turns: (people[turns], -turns))
    turns = best if people[best] >= max(MIN_PEOPLE, TIMES_MORE * people[0]) else 0
    floors = [fit_floor(turned_depth(depth, turns), turned_camera(camera, turns)) for _color, depth in chosen]
    floors = [floor for floor in floors if floor is not None]
    return CameraMount(len(chosen), people, turns, camera_pose_above(floors) if floors else None)


def _people_in(pairs, camera, turns):
    """Number of people in images that are turned clockwise by quarter turns."""
    detector, count = DepthPeople(), 0
    for color, depth in pairs:
        found = detector.detect(np.ascontiguousarray(turned_image(color, turns)), turned_depth(depth, turns),
                                turned_camera(camera, turns))
        count += 0 if found is None else len(found.boxes)
    return count
