"""Simulator: images of a scenario, poses of the robot, and ground truth."""
from typing import List, NamedTuple, Optional, Tuple

import cv2
import numpy as np

from ros_3d_bb.camera.camera_model import OPTICAL_ROTATION, Camera, transform_from, transform_points
from ros_3d_bb.core.object_classes import PERSON
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.tracking.types import OCCLUDED, OUT_OF_VIEW, VISIBLE, TrackedObject, prediction_times_s
from ros_3d_bb_lab.simulation.body import Body, Build
from ros_3d_bb_lab.simulation.mesh import box, rotation
from ros_3d_bb_lab.simulation.motion import State, object_motion, person_motion, robot_motion
from ros_3d_bb_lab.simulation.renderer import render
from ros_3d_bb_lab.simulation.room import RenderedRoom
from ros_3d_bb_lab.simulation.sensors import ColorSensor, StereoCamera
from ros_3d_bb_lab.simulation.scene_objects import GAP_M, PushedMotion, object_mesh

D435I_COLOR = Camera(640, 480, 614.686, 614.842, 319.199, 242.08)  # camera of the measurements in the thesis
FRONT_FROM_OPTICAL = transform_from((0, 0, 0), OPTICAL_ROTATION)
SHADOW_RADIUS_M = 0.28
STEP_S = 0.02  # maximum time between two states of the robot in ROS, as in the odometry of a Jackal
LEAST_SHOWN = 0.3  # visible share of the body below which its position cannot be estimated
JITTER_PX = 1.0  # standard deviation of the edges of boxes, as of a very good detector
MIN_VISIBLE = 0.25  # minimum share of the body in the image of a person with the status VISIBLE
MOVING_MPS = 0.05
PREDICTION_S, PREDICTION_STEP_S = 2.0, 0.25
SKINS = ((225, 180, 150), (215, 170, 140), (185, 140, 110), (230, 185, 155), (145, 105, 80))
HAIRS = ((60, 45, 35), (35, 30, 25), (25, 22, 20), (130, 95, 60), (120, 120, 120))
SHIRTS = ((30, 40, 60), (170, 45, 50), (185, 180, 165), (70, 130, 80), (60, 150, 190), (200, 150, 60), (90, 60, 120))
TROUSERS = ((85, 75, 60), (45, 60, 95), (40, 40, 45), (110, 100, 85), (60, 60, 65))
SHOES = ((45, 40, 40), (35, 35, 35), (205, 200, 200))


class PersonTruth(NamedTuple):
    """Ground truth of a person or another object in one frame, in the map frame. Shares are 0..1."""

    id: int                   # from 1, in the order of the scenario: people, then other objects
    position_m: np.ndarray    # (3,), centre of the body's vertical axis
    velocity_mps: np.ndarray  # (3,)
    size_m: np.ndarray        # width, width, height
    visible: float            # share of the body that the image shows
    hidden: float             # share of the body inside the image that other objects hide
    inside: float             # share of the body that lies inside the image
    box_px: Optional[Tuple[int, int, int, int]]  # bounding box (x1, y1, x2, y2) of the visible part, if there is one
    label: str = PERSON       # class


class Poses(NamedTuple):
    """Rigid transforms (4, 4) at one time. The camera frame is the optical one."""

    map_from_odom: np.ndarray
    odom_from_base: np.ndarray
    base_from_camera: np.ndarray

    @property
    def map_from_camera(self):
        return self.map_from_odom.dot(self.odom_from_base).dot(self.base_from_camera)


class WorldState(NamedTuple):
    """Robot and people at one time since the start."""

    time_s: float
    robot: State
    people: List[State]
    map_from_odom: np.ndarray  # (4, 4)


class SimulatedFrame(NamedTuple):
    number: int
    time_s: float         # since the start
    color: np.ndarray     # (h, w, 3), uint8 RGB
    depth_mm: np.ndarray  # (h, w), uint16, aligned to colour; 0 means no depth
    poses: Poses
    people: List[PersonTruth]
    camera_name: str = ''  # '' if there is only one
    objects: Tuple[PersonTruth, ...] = ()  # objects other than people

    @property
    def truth(self):
        return self.people + list(self.objects)


class Simulator(object):
    """Renders a scenario (scenario.Scenario). A frame depends only on the scenario and the number of the frame, or on
    the given state of the world.

    Several cameras take turns at equal intervals: of n cameras the first one has the frames 0, n, 2 n, ... All have the
    intrinsics of `camera` (camera_model.Camera).
    """

    def __init__(self, scenario, camera=D435I_COLOR):
        self.scenario, self.camera = scenario, camera
        self.camera_names = [mount.name for mount in scenario.robot.mounts]  # [''] if there is only one
        self.rate = scenario.rate * len(self.camera_names)  # frames per second of all cameras together
        self.frame_count = int(np.ceil(scenario.duration * self.rate))
        self._room = RenderedRoom(scenario.room.bounds, scenario.room.height, np.random.RandomState(scenario.seed))
        self._furniture = [box(item.size, item.color, np.random.RandomState(number)).moved(item.at + (0,), item.yaw)
                           for number, item in enumerate(scenario.room.furniture)]
        self.bodies = [Body(_build(person, scenario.seed, number), np.random.RandomState(number))
                       for number, person in enumerate(scenario.people)]
        self.motions = [person_motion(person, body.build.height_m, scenario.duration)
                        for person, body in zip(scenario.people, self.bodies)]
        self._meshes = [object_mesh(scene_object, np.random.RandomState(number))
                        for number, scene_object in enumerate(scenario.objects)]
        self._motions_of_objects = [self._motion_of(scene_object, mesh)
                                    for scene_object, mesh in zip(scenario.objects, self._meshes)]
        self._robot = robot_motion(scenario.robot, self.motions, scenario.duration)
        self._color_sensor = ColorSensor(camera, scenario.seed, scenario.color_noise)
        self._stereo = StereoCamera(camera, scenario.seed) if scenario.depth_noise else None

    def time_s(self, number):
        return number / self.rate

    def steps(self):
        """List of (time in s, number of the image at this time or None): all multiples of `STEP_S`, and the images."""
        count = int(self.scenario.duration / STEP_S) + 1
        steps = {int(round(step * STEP_S * NS)): (step * STEP_S, None) for step in range(count)}
        for number in range(self.frame_count):
            time_s = self.time_s(number)
            steps[int(round(time_s * NS))] = time_s, number
        return [steps[time_ns] for time_ns in sorted(steps)]

    def frame(self, number, state=None):
        """Render a frame. `state` is the WorldState; by default, that of the moves. Returns a SimulatedFrame."""
        time_s, turn = self.time_s(number), number % len(self.camera_names)
        state = state or self.state_at(time_s)
        poses, states = self.poses(state, turn), state.people
        bodies = [body.posed(state.posture).moved(np.append(state.position_m, 0), state.heading_rad)
                  for body, state in zip(self.bodies, states)]
        states = list(states) + [motion.at(time_s) for motion in self._motions_of_objects]
        bodies += [mesh.moved(np.append(state.position_m, 0), state.heading_rad)
                   for mesh, state in zip(self._meshes, states[len(bodies):])]
        shadows = [(state.position_m[0], state.position_m[1], SHADOW_RADIUS_M) for state in states]
        rendering = render(self._room, bodies + self._furniture, shadows, self.camera, poses.map_from_camera)
        depth_mm = (self._stereo.measure(rendering.inverse_depth, number) if self._stereo is not None
                    else np.rint(1000 / rendering.inverse_depth).clip(0, 65535).astype(np.uint16))
        truth = [self._truth(index, state, bodies[index], rendering) for index, state in enumerate(states)]
        people, objects = truth[:len(self.bodies)], tuple(truth[len(self.bodies):])
        color = self._color_sensor.capture(rendering.color, number)
        return SimulatedFrame(number, time_s, color, depth_mm, poses, people, self.camera_names[turn], objects)

    def state_at(self, time_s):
        x, y, yaw = np.array(self.scenario.robot.odometry_drift) * time_s
        return WorldState(time_s, self._robot.at(time_s), [motion.at(time_s) for motion in self.motions],
                          upright(x, y, 0, yaw))

    def poses(self, state, camera_index=0):
        """Poses of odometry, robot and one of the cameras in a WorldState."""
        robot, (x, y) = self.scenario.robot, state.robot.position_m
        mount = robot.mounts[camera_index]
        map_from_base = upright(x, y, robot.base_height, state.robot.heading_rad)
        base_from_mount, tilted = upright(*mount.mount + (mount.yaw,)), np.eye(4)
        tilted[:3, :3] = rotation(1, mount.pitch)
        return Poses(state.map_from_odom, np.linalg.inv(state.map_from_odom).dot(map_from_base),
                     base_from_mount.dot(tilted).dot(FRONT_FROM_OPTICAL))

    def positions_at(self, time_s):
        """Positions (n, 2) of people and objects in the map by their moves. The time may be after the end of the scene.
        """
        motions = self.motions + self._motions_of_objects
        return np.array([motion.at(time_s).position_m for motion in motions]).reshape(-1, 2)

    def true_tracks(self, frame, stamp_ns):
        """Convert the objects of a frame to tracks (TrackedObject) in the map, first seen at the start of the scene.

        Their predictions are their actual future positions. People who give way are assumed to continue as their moves,
        from where they are.
        """
        times_s = prediction_times_s(PREDICTION_S, PREDICTION_STEP_S)
        paths = np.stack([self.positions_at(frame.time_s + time_s) for time_s in times_s], axis=1)
        positions = np.array([truth.position_m[:2] for truth in frame.truth]).reshape(-1, 2)
        pushed_m = positions - self.positions_at(frame.time_s)
        if pushed_m.any():
            paths += pushed_m[:, None]
        start_ns = stamp_ns - int(round(frame.time_s * NS))
        return [TrackedObject(person.id, person.position_m, person.size_m, person.velocity_mps,
                              _status(person), bool(np.linalg.norm(person.velocity_mps) > MOVING_MPS), start_ns,
                              stamp_ns, np.c_[path, np.full(len(path), person.position_m[2])], PREDICTION_STEP_S,
                              label=person.label)
                for person, path in zip(frame.truth, paths)]

    def _truth(self, index, state, body, rendering):
        height_m, number = float(body.vertices[:, 2].max()), index - len(self.bodies)
        width_m = self.bodies[index].width_m if number < 0 else _largest_extent(self._meshes[number])
        visible = cv2.inRange(rendering.objects, index + 1, index + 1)
        count = cv2.countNonZero(visible)
        x, y, width, height = cv2.boundingRect(visible)
        hidden = 1 - count / float(rendering.areas[index]) if rendering.areas[index] else 0.0
        inside = rendering.inside[index]
        return PersonTruth(index + 1, np.append(state.position_m, height_m / 2), np.append(state.velocity_mps, 0),
                           np.array([width_m, width_m, height_m]), (1 - hidden) * inside, hidden, inside,
                           (x, y, x + width, y + height) if count else None,
                           PERSON if number < 0 else self.scenario.objects[number].label)

    def _motion_of(self, scene_object, mesh):
        if scene_object.pushed_by is None:
            return object_motion(scene_object, self.scenario.duration)
        return PushedMotion(self.motions[scene_object.pushed_by - 1], GAP_M + float(np.ptp(mesh.vertices[:, 0])) / 2)


def _largest_extent(mesh):
    return float(np.ptp(mesh.vertices[:, :2], axis=0).max())


def _status(person):
    if person.visible >= MIN_VISIBLE:
        return VISIBLE
    return OCCLUDED if person.hidden > 1 - person.inside else OUT_OF_VIEW  # the larger share decides


def upright(x, y, z, yaw):
    """Transform (4, 4) of a translation and a rotation about z."""
    transform = np.eye(4)
    transform[:3, :3], transform[:3, 3] = rotation(2, yaw), (x, y, z)
    return transform


def _build(person, seed, number):
    """Appearance of a person: random by the seed, except for the height if the scenario specifies it."""
    random = np.random.RandomState([seed, number])

    def choice(colors):
        return colors[random.randint(len(colors))]

    shirts = np.random.RandomState(seed).permutation(len(SHIRTS))  # different shirts for successive people
    build = Build(random.uniform(1.58, 1.92), random.uniform(.95, 1.25), float(random.randint(2)),
                  bool(random.randint(2)), bool(random.randint(2)), choice(SKINS), choice(HAIRS),
                  SHIRTS[shirts[number % len(SHIRTS)]], choice(TROUSERS), choice(SHOES))
    return build if person.height is None else build._replace(height_m=person.height)


def jittered_boxes(frame, camera, seed):
    """True boxes (n, 4) of the people in a SimulatedFrame, with edges jittered by `JITTER_PX`.

    They are those of people with `is_in_image`, or with at least `LEAST_SHOWN` of the body visible.
    """
    random = np.random.RandomState([seed, frame.number])
    jitter_px = np.rint(random.normal(0, JITTER_PX, (len(frame.people), 4)))
    shown = [person.visible >= LEAST_SHOWN or is_in_image(person, frame.poses.map_from_camera, camera)
             for person in frame.people]
    boxes = [person.box_px + jitter for person, jitter, is_shown in zip(frame.people, jitter_px, shown) if is_shown]
    return np.clip(np.reshape(boxes, (-1, 4)), 0, [camera.width, camera.height] * 2)


def is_in_image(person, map_from_camera, camera):
    """Whether the body axis of a PersonTruth is between the left and right image borders, and not mostly occluded."""
    x_m, _y, z_m = transform_points(np.linalg.inv(map_from_camera), person.position_m)
    if person.box_px is None or person.hidden > 1 - LEAST_SHOWN or z_m <= 0:
        return False
    return bool(0 <= camera.fx * x_m / z_m + camera.cx < camera.width)
