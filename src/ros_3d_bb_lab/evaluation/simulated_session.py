"""Simulated measurement sessions with exact ground truth, for the error model of the simulated camera.

People of different builds stand on a grid of positions or walk across them in random directions. `./run noise` analyses
the session as any other.
"""
import argparse

import numpy as np

from ros_3d_bb.camera.camera_model import transform_points
from ros_3d_bb.camera.images import DepthImage
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.sessions.session_writer import append, locked_update
from ros_3d_bb.sessions.snapshots import ColorImage, Snapshot
from ros_3d_bb_lab.simulation.scenario import Move, Person, Robot, Room, Scenario
from ros_3d_bb_lab.simulation.simulator import D435I_COLOR, Simulator

RANGES_M = (1.0, 1.25, 1.5, 1.75, 2.0, 2.5, 3.0, 3.5, 4.0, 4.5, 5.0, 6.0)
TANGENTS = (-0.4, -0.25, -0.1, 0.0, 0.1, 0.25, 0.4)  # tangent of the angle off the optical axis
ROOM = Room(bounds=(-2.0, 9.0, -5.0, 5.0))
ROBOT = Robot()
WALK_S, SPEED_MPS = 1.0, 1.2  # a walker passes the position after WALK_S
REPETITIONS = 3


def write_simulated_session(folder, ranges_m=RANGES_M, tangents=TANGENTS, repetitions=REPETITIONS):
    """Write a session of simulated people with exact 2D boxes, except outside the image. Returns the folder."""
    positions_m = [(z_m, round(tangent * z_m, 3)) for z_m in ranges_m for tangent in tangents]
    for number in range(len(positions_m) * repetitions):
        _append_frame(folder, number, *positions_m[number // repetitions])
    return folder


def _append_frame(folder, number, z_m, x_m):
    """Append the image of a person at a position in the camera frame, unless the person is outside of the image."""
    simulator = Simulator(_scenario(np.array([ROBOT.pose[0] + ROBOT.mount[0] + z_m, ROBOT.pose[1] - x_m]), number))
    frame = simulator.frame(simulator.frame_count - 1)
    person = frame.people[0]
    if person.box_px is None:
        return
    append(folder, Snapshot(number * NS, ColorImage(frame.color, 'camera_color_optical_frame'),
                            DepthImage(frame.depth_mm, 0.001), D435I_COLOR, (tuple(person.box_px),), None))
    x_m, _y_m, z_m = transform_points(np.linalg.inv(frame.poses.map_from_camera), person.position_m)
    with locked_update(folder) as content:
        content['frames'][-1]['truth_mm'] = {'x': round(1000 * x_m), 'z': round(1000 * z_m)}


def _scenario(position_m, number):
    """Scenario whose person is at a position (x, y) of the map in the last image. Every second person walks."""
    heading_rad = float(np.random.RandomState(number).uniform(-np.pi, np.pi))
    step_m = WALK_S * SPEED_MPS * np.array([np.cos(heading_rad), np.sin(heading_rad)])
    if number % 2:
        walk = Move(to=tuple(position_m + step_m), speed=SPEED_MPS)
        person = Person(tuple(position_m - step_m), heading_rad, moves=(walk,))
    else:
        person = Person(tuple(position_m), heading_rad)
    # two images: at the start, and when the walker passes the place
    return Scenario(duration=2 * WALK_S, rate=1 / WALK_S, seed=number, room=ROOM, robot=ROBOT, people=(person,))


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('folder', help='output folder')
    print(write_simulated_session(parser.parse_args().folder))


if __name__ == '__main__':
    main()
