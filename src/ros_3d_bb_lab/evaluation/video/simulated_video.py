"""A short simulated video of two people who pass each other, with exact truth, in the form of a recorded one."""
import json
import os

import cv2

from ros_3d_bb_lab.simulation.scenario import Move, Person, Robot, Scenario
from ros_3d_bb_lab.simulation.simulator import Simulator

RATE_HZ = 5.0
SCENE = Scenario(duration=6.0, rate=RATE_HZ, seed=3, robot=Robot(mount=(0.0, 0.0, 1.2), pitch=0.15), people=(
    Person((4.0, -1.2), 1.6, moves=(Move(to=(4.0, 1.6), speed=0.6),)),
    Person((5.2, 1.2), -1.6, moves=(Move(to=(5.2, -1.6), speed=0.6),))))
MARKED_EVERY = 2


def write_simulated_video(folder, scenario=SCENE):
    """Write the video of a scenario to a folder, and `truth.json` with its people in every second image. Returns the
    folder."""
    simulator, frames = Simulator(scenario), {}
    for kind in ('color', 'depth'):
        os.makedirs(os.path.join(folder, kind))
    for number in range(simulator.frame_count):
        frame, name = simulator.frame(number), '%03d' % number
        cv2.imwrite(os.path.join(folder, 'color', name + '.jpg'), frame.color[..., ::-1])
        cv2.imwrite(os.path.join(folder, 'depth', name + '.png'), frame.depth_mm)
        if number % MARKED_EVERY == 0:
            frames[name] = [{'id': person.id, 'rect': list(map(int, person.box_px)), 'visible': float(person.visible)}
                            for person in frame.people if person.box_px is not None]
    camera = simulator.camera
    _write(folder, 'camera.json', {'width': camera.width, 'height': camera.height, 'depth_unit_m': 0.001,
                                   'K': [camera.fx, 0.0, camera.cx, 0.0, camera.fy, camera.cy, 0.0, 0.0, 1.0]})
    _write(folder, 'truth.json', {'rate': scenario.rate, 'frames': frames})
    return folder


def _write(folder, name, content):
    with open(os.path.join(folder, name), 'w') as stream:
        json.dump(content, stream)
