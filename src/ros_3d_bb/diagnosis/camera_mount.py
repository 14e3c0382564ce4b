"""Mount of a camera, from its images: height, tilt and roll by the floor, quarter turns and unit of depth by people."""
from typing import NamedTuple, Optional

import numpy as np

from ros_3d_bb.camera.images import turned_camera, turned_depth, turned_image
from ros_3d_bb.detection.depth.detector import DepthPeople
from ros_3d_bb.detection.depth.ground_plane import CameraPose, camera_pose_above, fit_floor

IMAGES = 8  # that are used, of those given
FEW = 0.5  # people per image, below which other rotations and units are tried
MIN_PEOPLE, TIMES_MORE = 4, 3  # that are found in changed images, at least, and relative to the images as received
UNITS = 0.1, 0.2, 0.25, 10.0  # of depth, by the one assumed: 0.1 mm, as in TUM RGB-D, of a RealSense L515, and 1 cm


class CameraMount(NamedTuple):
    """Mount of a camera: number of people in the images by quarter turns, and by the factor of depth; the turns and the
    factors that explain them; and the pose for these turns, None if no floor is visible.
    """

    images: int
    people: dict
    turns: int
    pose: Optional[CameraPose] = None
    factors: dict = {}  # {factor: (people, pose)}, if there are more than in the images as received


def camera_mount(pairs, camera):
    """Return the CameraMount of a Camera, from pairs of an RGB image (h, w, 3) and aligned DepthImage of one time; None
    without any. Without colour, people are not searched.
    """
    if not pairs:
        return None
    chosen = [pairs[number] for number in np.unique(np.linspace(0, len(pairs) - 1, IMAGES).astype(int))]
    people, factors, has_color = {0: 0}, {}, chosen[0][0] is not None
    if has_color:
        people[0] = _people_in(chosen, camera, 0)
    enough = max(MIN_PEOPLE, TIMES_MORE * people[0])
    if has_color and people[0] < FEW * len(chosen):
        people.update({turns: _people_in(chosen, camera, turns) for turns in (1, 2, 3)})
    best = max(people, key=lambda turns: (people[turns], -turns))
    turns = best if people[best] >= enough else 0
    if len(people) > 1 and not turns:
        scaled = {factor: _scaled(chosen, factor) for factor in UNITS}
        found = {factor: (_people_in(pairs, camera, 0), _pose_in(pairs, camera, 0)) for factor, pairs in scaled.items()}
        factors = {factor: (count, pose) for factor, (count, pose) in found.items() if count >= enough}
    return CameraMount(len(chosen), people, turns, _pose_in(chosen, camera, turns), factors)


def _pose_in(pairs, camera, turns):
    """CameraPose above the floor in images that are turned clockwise by quarter turns; None if none shows it."""
    floors = [fit_floor(turned_depth(depth, turns), turned_camera(camera, turns)) for _color, depth in pairs]
    floors = [floor for floor in floors if floor is not None]
    return camera_pose_above(floors) if floors else None


def _scaled(pairs, factor):
    return [(color, depth._replace(scale_m=factor * depth.scale_m)) for color, depth in pairs]


def _people_in(pairs, camera, turns):
    detector, count = DepthPeople(), 0
    for color, depth in pairs:
        found = detector.detect(np.ascontiguousarray(turned_image(color, turns)), turned_depth(depth, turns),
                                turned_camera(camera, turns))
        count += 0 if found is None else len(found.boxes)
    return count
