import numpy as np
import pytest

from ros_3d_bb.camera.camera_model import Camera
from ros_3d_bb_lab.simulation.driven_world import COMMAND_TIMEOUT_S, DrivenWorld
from ros_3d_bb_lab.simulation.scenario import Furniture, Move, Person, Room, Scenario
from ros_3d_bb_lab.simulation.simulator import STEP_S, Simulator

CAMERA = Camera(8, 6, 8, 8, 4, 3)
ROOM = Room(bounds=(-3.0, 12.0, -4.0, 4.0))


def simulator_of(*people, **others):
    values = dict(duration=12.0, rate=15.0, seed=4, depth_noise=False, color_noise=0.0, people=people, room=ROOM)
    return Simulator(Scenario(**dict(values, **others)), CAMERA)


def driven(world, until_s, command=(1.0, 0.0), from_s=0.0):
    """States of a world every 10 ms while the command is repeated every 100 ms."""
    states = []
    for step in range(int(round(from_s / STEP_S)), int(round(until_s / STEP_S)) + 1):
        if command is not None and step % 10 == 0:
            world.command(*command)
        states.append(world.state_at(step * STEP_S))
    return states


def test_the_robot_obeys_commands_and_stops_without_them():
    world = DrivenWorld(simulator_of())
    moving = driven(world, 4.0, (0.5, 0.0))
    assert moving[0].robot.velocity_mps[0] == 0
    np.testing.assert_allclose(moving[200].robot.velocity_mps, (.5, 0))
    stopping = driven(world, 7.0, None, from_s=4.01)
    speeds_mps = [state.robot.velocity_mps[0] for state in stopping]
    assert speeds_mps[int(COMMAND_TIMEOUT_S / STEP_S) - 5] == pytest.approx(.5)
    assert speeds_mps[-1] == 0 == speeds_mps[int((COMMAND_TIMEOUT_S + .3) / STEP_S)]
    assert stopping[-1].robot.position_m[0] == stopping[-100].robot.position_m[0] > 1.9


def test_the_robot_stops_at_furniture_and_says_so_once():
    world = DrivenWorld(simulator_of(room=ROOM._replace(furniture=(Furniture((3.0, 0.0), (1.0, 1.0, 1.0)),))))
    end = driven(world, 6.0)[-1]
    assert end.robot.position_m[0] == pytest.approx(3 - .5 - .255, abs=.011)
    collision, = world.collisions
    assert (collision.object, collision.speed_mps) == ('furniture 1', pytest.approx(1.0))
    backward = driven(world, 7.5, (-1.0, 0.0), from_s=6.01)[-1]
    assert backward.robot.position_m[0] < 1.5 and len(world.collisions) == 1
    driven(world, 11.0, from_s=7.51)
    assert [collision.object for collision in world.collisions] == ['furniture 1'] * 2


@pytest.mark.parametrize('moves, start', [((Move(to=(-2.0, 0.0), speed=1.2),), (6.0, .1)), ((), (3.0, .1))])
def test_people_give_way_to_the_robot(moves, start):
    person = Person(start, moves=moves)
    stubborn, polite = (DrivenWorld(simulator_of(person._replace(gives_way=gives_way))) for gives_way in (False, True))
    for world in (stubborn, polite):
        driven(world, 6.0, (.6, 0.0))
    assert [collision.object for collision in stubborn.collisions] == ['person 1']
    assert polite.collisions == []
