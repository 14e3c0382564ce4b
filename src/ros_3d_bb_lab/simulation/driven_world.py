"""World of a scenario with a robot that obeys velocity commands, and people who may give way to it.

Convention: map frame, metres, radians, seconds; poses are (x, y, heading), velocities (linear, angular). The states
depend only on the scenario, the times at which they are requested, and the commands between them.
"""
from typing import NamedTuple

import numpy as np

from ros_3d_bb_lab.simulation.collision import Rectangle, nearest_wall_points
from ros_3d_bb_lab.simulation.gait import Posture, stride_m
from ros_3d_bb_lab.simulation.motion import WALKING_MPS, State, wrapped
from ros_3d_bb_lab.simulation.social_force import RELAXATION_S, next_velocity, social_force
from ros_3d_bb_lab.simulation.simulator import WorldState, upright

LONGEST_STEP_S = 0.01  # of the motion
COMMAND_TIMEOUT_S = 0.5  # the robot stops if the last command is older
CONTACT_S = 1.0  # contacts with the same object within this time are one collision
FACING_MPS = 0.2  # at this speed people face the direction of walking
TURN_RATE = 3.0  # of people who give way
ROUNDING_M = 1e-9
WALL = 'a wall'


class Collision(NamedTuple):
    """Beginning of a contact of the robot."""

    time_s: float
    object: str       # 'person 1', 'furniture 1' or 'a wall'; numbers as in the scenario
    speed_mps: float  # of the robot


def limited_velocity(velocity, wanted, drive, step_s):
    """Velocity (2,) after a time step towards the wanted one, within the limits of a `scenario.Drive`."""
    fastest = np.array([drive.speed, drive.rate])
    change = np.array([drive.acceleration, drive.angular_acceleration]) * step_s
    return velocity + np.clip(np.clip(wanted, -fastest, fastest) - velocity, -change, change)


def moved(pose, velocity, step_s):
    """Pose (3,) after a time step at constant velocity, which is an arc of a circle."""
    turn = velocity[1] * step_s
    chord_m = velocity[0] * step_s * np.sinc(turn / 2 / np.pi)
    heading = pose[2] + turn / 2
    return pose + np.array([chord_m * np.cos(heading), chord_m * np.sin(heading), turn])


class DrivenWorld(object):
    """Robot and people of a Simulator; the moves of the robot are ignored.

    The robot does not move into people, furniture or walls: it stops. People may walk into the robot. People who
    `gives_way` follow their moves with the forces of `social_force`: they are attracted by where their moves place them
    `RELAXATION_S` later, and repelled by other people, the robot, furniture and walls.

    Attributes: `collisions`, a list of Collision; `odometry_velocity` (2,), the linear and angular velocity that the
    robot measures.
    """

    def __init__(self, simulator):
        scenario = simulator.scenario
        self._room, self._robot = scenario.room, scenario.robot
        self._furniture = [Rectangle(item.at, item.yaw, item.size[:2]) for item in scenario.room.furniture]
        self._pose, self._odometry = (np.array(scenario.robot.pose, float) for _pose in range(2))
        self._velocity, self.odometry_velocity = np.zeros(2), np.zeros(2)
        self._wanted, self._commanded_s = np.zeros(2), -np.inf
        self._people = [_Person(person, motion, body) for person, motion, body
                        in zip(scenario.people, simulator.motions, simulator.bodies)]
        self._radii_m = np.array([body.width_m / 2 for body in simulator.bodies])
        self._time_s, self._touched_s = 0.0, {}
        self.collisions = []
        objects = self._static_contacts(self._footprint(self._pose))
        if objects:
            raise ValueError('robot.pose is %s, where the robot of %g x %g m overlaps %s; a free place expected' % (
                (list(scenario.robot.pose),) + self._robot.drive.footprint + (', '.join(sorted(objects)),)))

    @property
    def clearance_m(self):
        """Distance between the robot and the nearest person, negative during a contact; infinite without people."""
        return float(self._distances_m(self._pose).min()) if self._people else float('inf')

    def command(self, linear_mps, angular_radps):
        """Set the velocity that the robot takes up. Raises ValueError if it is not finite."""
        wanted = np.array([linear_mps, angular_radps])
        if not np.isfinite(wanted).all():
            raise ValueError('the velocity (%s, %s) is not finite' % (linear_mps, angular_radps))
        self._wanted, self._commanded_s = wanted, self._time_s

    def state_at(self, time_s):
        """Advance to a time since the start and return the WorldState. Raises ValueError if the time is in the past."""
        if time_s < self._time_s:
            raise ValueError('time %g is before the current time %g of the world' % (time_s, self._time_s))
        steps = int(np.ceil((time_s - self._time_s) / LONGEST_STEP_S - 1e-6))
        for time_after_s in np.linspace(self._time_s, time_s, steps + 1)[1:]:
            self._step(float(time_after_s))
        map_from_robot, odom_from_robot = (upright(x, y, 0, yaw) for x, y, yaw in (self._pose, self._odometry))
        return WorldState(time_s, self._robot_state(), [person.state for person in self._people],
                          map_from_robot.dot(np.linalg.inv(odom_from_robot)))

    def _robot_state(self):
        heading = self._pose[2]
        velocity = self._velocity[0] * np.array([np.cos(heading), np.sin(heading)])
        return State(self._pose[:2], velocity, float(heading), Posture())

    def _step(self, time_s):
        step_s, self._time_s = time_s - self._time_s, time_s
        for person in self._people:
            person.advance(time_s, step_s, self._forces_on(person) if person.gives_way else None)
        wanted = self._wanted if time_s - self._commanded_s <= COMMAND_TIMEOUT_S else np.zeros(2)
        velocity = limited_velocity(self._velocity, wanted, self._robot.drive, step_s)
        pose = moved(self._pose, velocity, step_s)
        if self._is_blocked(pose, float(abs(velocity[0]))):
            pose, velocity = self._pose, np.zeros(2)
        self._pose, self._velocity = pose, velocity
        self.odometry_velocity = velocity * (1 + np.array(self._robot.drive.odometry_error))
        self._odometry = moved(self._odometry, self.odometry_velocity, step_s)

    def _is_blocked(self, pose, speed_mps):
        """Whether objects keep the robot from moving to a pose; it may move away from people. Contacts are noted."""
        static = self._static_contacts(self._footprint(pose))
        before_m, after_m = self._distances_m(self._pose), self._distances_m(pose)
        touched = np.minimum(before_m, after_m) <= 0
        self._note_contacts(static + ['person %d' % (index + 1) for index in np.nonzero(touched)[0]], speed_mps)
        return bool(static) or bool(((after_m <= 0) & (after_m < before_m - ROUNDING_M)).any())

    def _note_contacts(self, names, speed_mps):
        for name in names:
            if self._time_s - self._touched_s.get(name, -np.inf) > CONTACT_S:
                self.collisions.append(Collision(self._time_s, name, speed_mps))
            self._touched_s[name] = self._time_s

    def _footprint(self, pose):
        return Rectangle(tuple(pose[:2]), pose[2], self._robot.drive.footprint)

    def _static_contacts(self, footprint):
        names = ['furniture %d' % number for number, rectangle in enumerate(self._furniture, 1)
                 if footprint.overlaps(rectangle)]
        return names if footprint.is_within(self._room.bounds) else names + [WALL]

    def _distances_m(self, pose):
        """Distances (n,) between the robot at a pose and the people, who are vertical cylinders."""
        positions = np.array([person.state.position_m for person in self._people]).reshape(-1, 2)
        return self._footprint(pose).signed_distances_m(positions) - self._radii_m

    def _forces_on(self, person):
        """Arguments of `social_force` for a person: other people and the robot, and the nearest points of borders."""
        position = person.state.position_m
        others = [other.state for other in self._people if other is not person] + [self._robot_state()]
        borders = [position - rectangle.nearest_point(position)
                   for rectangle in self._furniture + [self._footprint(self._pose)]]
        walls = position - nearest_wall_points(position, self._room.bounds)
        return (position - [other.position_m for other in others], np.array([other.velocity_mps for other in others]),
                np.concatenate([borders, walls]))


class _Person(object):
    """A person who follows scripted moves exactly, or gives way."""

    def __init__(self, person, motion, body):
        self.gives_way, self._motion, self._stride_m = person.gives_way, motion, stride_m(body.build.height_m)
        self.state = motion.at(0.0)

    def advance(self, time_s, step_s, forces):
        scripted = self._motion.at(time_s)
        self.state = scripted if forces is None else self._pushed(scripted, time_s, step_s, forces)

    def _pushed(self, scripted, time_s, step_s, forces):
        """State after a step of `social_force`."""
        before = self.state
        target = self._motion.at(time_s + RELAXATION_S).position_m
        desired = (target - before.position_m) / RELAXATION_S
        velocity = next_velocity(before.velocity_mps, social_force(before.velocity_mps, desired, *forces), step_s)
        speed_mps = float(np.linalg.norm(velocity))
        swing = min(1.0, speed_mps / WALKING_MPS) ** .5
        phase = before.posture.phase + speed_mps * step_s / (self._stride_m * max(swing, .1))
        facing = np.arctan2(velocity[1], velocity[0]) if speed_mps > FACING_MPS else scripted.heading_rad
        turn = np.clip(wrapped(facing - before.heading_rad), -TURN_RATE * step_s, TURN_RATE * step_s)
        return State(before.position_m + velocity * step_s, velocity, before.heading_rad + float(turn),
                     Posture(phase, swing, scripted.posture.crouch))
