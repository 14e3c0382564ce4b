import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from ros_3d_bb.camera.camera_model import Camera
from ros_3d_bb.tracking.types import OCCLUDED, VISIBLE
from ros_3d_bb_lab.simulation.driven_world import COMMAND_TIMEOUT_S, DrivenWorld
from ros_3d_bb_lab.simulation.scenario import Furniture, Move, Person, Room, Scenario
from ros_3d_bb_lab.simulation.sensors import StereoCamera
from ros_3d_bb_lab.simulation.simulator import STEP_S, Simulator

CAMERA = Camera(160, 120, 153.7, 153.7, 79.8, 60.5)
HALL = Room(furniture=(Furniture((3.0, 0.0), (.4, .8, 2.8)),))
PILLAR_WALK = Person((5.0, 2.0), moves=(Move(to=(5.0, -2.0), speed=1.0),))
START_NS = 1600000000 * 10 ** 9


def scene(*people, **others):
    values = dict(duration=3.0, rate=10.0, seed=4, depth_noise=False, color_noise=0.0, people=people)
    return Scenario(**dict(values, **others))


def frame_of(*people, **others):
    return Simulator(scene(*people, **others), CAMERA).frame(0)


@pytest.fixture(scope='module')
def pillar():
    """Simulator of a person who walks behind a pillar, and a frame every 0.2 s."""
    simulator = Simulator(scene(PILLAR_WALK, room=HALL, duration=4.0), CAMERA)
    return simulator, [simulator.frame(number) for number in range(0, simulator.frame_count, 2)]


def test_a_frame_depends_on_scenario_and_number_only():
    noisy = scene(Person((3, 0), moves=(Move(to=(5, 1)),)), depth_noise=True, color_noise=2.0, room=HALL)
    forward, backward = Simulator(noisy, CAMERA), Simulator(noisy, CAMERA)
    numbers = (0, 5)
    frames = {number: forward.frame(number) for number in numbers}
    for number in reversed(numbers):
        other = backward.frame(number)
        assert other.color.tobytes() == frames[number].color.tobytes()
        assert other.depth_mm.tobytes() == frames[number].depth_mm.tobytes()
        assert str(other.people) == str(frames[number].people)
    different = Simulator(noisy._replace(seed=5), CAMERA).frame(5)
    assert different.color.tobytes() != frames[5].color.tobytes()
    assert different.depth_mm.tobytes() != frames[5].depth_mm.tobytes()


@pytest.fixture(scope='module')
def empty_simulator():
    return Simulator(scene(), CAMERA)


@pytest.mark.slow
@given(st.floats(2.5, 7), st.floats(-2, 2), st.floats(-3, 3))
@settings(max_examples=12)
def test_the_box_encloses_the_pixels_of_the_person(empty_simulator, x, y, facing):
    """Pixels whose depth differs from the empty room. Soles may differ by less than 1 mm, so one row may be missing.
    """
    frame = frame_of(Person((x, y), facing=facing))
    changed, (truth,) = frame.depth_mm != empty_simulator.frame(0).depth_mm, frame.people
    if truth.box_px is None:
        assert not changed.any()
        return
    x1, y1, x2, y2 = truth.box_px
    rows, columns = np.flatnonzero(changed.any(axis=1)), np.flatnonzero(changed.any(axis=0))
    assert (x1, y1, x2) == (columns[0], rows[0], columns[-1] + 1) and 0 <= y2 - rows[-1] - 1 <= 1


def test_a_person_behind_a_pillar_is_occluded(pillar):
    simulator, frames = pillar
    status = [simulator.true_tracks(frame, START_NS)[0].status for frame in frames]
    hidden = [frame.people[0].hidden for frame in frames]
    assert status[0] == status[-1] == VISIBLE and max(hidden) == 1
    occluded = [number for number, value in enumerate(status) if value == OCCLUDED]
    assert occluded == list(range(occluded[0], occluded[-1] + 1)) and len(occluded) >= 2
    assert set(status) == {VISIBLE, OCCLUDED}
    for frame, value in zip(frames, status):
        person = frame.people[0]
        assert (value == OCCLUDED) == (person.hidden > .75)
        assert person.visible == pytest.approx(1 - person.hidden, abs=.01)  # completely inside the image


SMALL_CAMERA = Camera(8, 6, 8, 8, 4, 3)
ROOM = Room(bounds=(-3.0, 12.0, -4.0, 4.0))


def simulator_with(*people, **others):
    values = dict(duration=12.0, rate=15.0, seed=4, depth_noise=False, color_noise=0.0, people=people, room=ROOM)
    return Simulator(Scenario(**dict(values, **others)), SMALL_CAMERA)


def driven(world, until_s, command=(1.0, 0.0), from_s=0.0):
    """States of a world every 10 ms while the command is repeated every 100 ms."""
    states = []
    for step in range(int(round(from_s / STEP_S)), int(round(until_s / STEP_S)) + 1):
        if command is not None and step % 10 == 0:
            world.command(*command)
        states.append(world.state_at(step * STEP_S))
    return states


def test_the_robot_obeys_commands_and_stops_without_them():
    world = DrivenWorld(simulator_with())
    moving = driven(world, 4.0, (0.5, 0.0))
    assert moving[0].robot.velocity_mps[0] == 0
    np.testing.assert_allclose(moving[200].robot.velocity_mps, (.5, 0))
    stopping = driven(world, 7.0, None, from_s=4.01)
    speeds_mps = [state.robot.velocity_mps[0] for state in stopping]
    assert speeds_mps[int(COMMAND_TIMEOUT_S / STEP_S) - 5] == pytest.approx(.5)
    assert speeds_mps[-1] == 0 == speeds_mps[int((COMMAND_TIMEOUT_S + .3) / STEP_S)]
    assert stopping[-1].robot.position_m[0] == stopping[-100].robot.position_m[0] > 1.9


def test_the_robot_stops_at_furniture_and_says_so_once():
    world = DrivenWorld(simulator_with(room=ROOM._replace(furniture=(Furniture((3.0, 0.0), (1.0, 1.0, 1.0)),))))
    end = driven(world, 6.0)[-1]
    assert end.robot.position_m[0] == pytest.approx(3 - .5 - .255, abs=.011)
    collision, = world.collisions
    assert (collision.object, collision.speed_mps) == ('furniture 1', pytest.approx(1.0))
    backward = driven(world, 7.5, (-1.0, 0.0), from_s=6.01)[-1]
    assert backward.robot.position_m[0] < 1.5 and len(world.collisions) == 1
    driven(world, 11.0, from_s=7.51)
    assert [collision.object for collision in world.collisions] == ['furniture 1'] * 2


@pytest.mark.slow
@pytest.mark.parametrize('moves, start', [((Move(to=(-2.0, 0.0), speed=1.2),), (6.0, .1)), ((), (3.0, .1))])
def test_people_give_way_to_the_robot(moves, start):
    person = Person(start, moves=moves)
    stubborn, polite = [DrivenWorld(simulator_with(person._replace(gives_way=given))) for given in (False, True)]
    for world in (stubborn, polite):
        driven(world, 6.0, (.6, 0.0))
    assert [collision.object for collision in stubborn.collisions] == ['person 1']
    assert polite.collisions == []


LEVEL_MM = 610140.  # depth levels are this divided by an integer
STEPS_PER_PX = 32
STEREO_CAMERA = Camera(400, 60, 614.686, 614.842, 200, 30)


def inverse_depth(depth_m, camera=STEREO_CAMERA):
    """Inverse depth image of depth in metres, which is broadcast to the image."""
    return np.ascontiguousarray(np.broadcast_to(1 / np.asarray(depth_m, float), (camera.height, camera.width)),
                                dtype=np.float32)


def test_noise_of_depth_grows_with_its_square():
    """As measured on walls by a D435i: 0.04 to 0.06 px of disparity."""
    for wall_m in (1.0, 2.0, 4.0):
        depth_mm = StereoCamera(STEREO_CAMERA, seed=1).measure(inverse_depth(wall_m), 0)[:, 100:].astype(float)
        noise_px = LEVEL_MM * depth_mm[depth_mm > 0].std() / (1000 * wall_m) ** 2 / STEPS_PER_PX
        assert 0.025 < noise_px < 0.1
