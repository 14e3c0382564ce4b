import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ros_3d_bb.camera.camera_model import Camera
from ros_3d_bb.tracking.types import OCCLUDED, VISIBLE
from ros_3d_bb_lab.simulation.scenario import Furniture, Move, Person, Room, Scenario
from ros_3d_bb_lab.simulation.simulator import Simulator

CAMERA = Camera(160, 120, 153.7, 153.7, 79.8, 60.5)
HALL = Room(furniture=(Furniture((3.0, 0.0), (.4, .8, 2.8)),))
PILLAR_WALK = Person((5.0, 2.0), moves=(Move(to=(5.0, -2.0), speed=1.0),))
START_NS = 1600000000 * 10 ** 9


def scene(*people, **others):
    """Scenario of 3 s without noise."""
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
