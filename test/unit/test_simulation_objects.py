"""Objects other than people in the simulator: shapes, motion, ground truth, and errors of estimated positions."""
import numpy as np
import pytest

from ros_3d_bb_lab.simulation.motion import person_motion
from ros_3d_bb_lab.simulation.scenario import Move, Person, SceneObject, Scenario
from ros_3d_bb_lab.simulation.scene_objects import GAP_M, PushedMotion
from ros_3d_bb_lab.simulation.simulator import Simulator


def test_a_pushed_object_is_in_front_of_the_person():
    moves = Move(to=(2.0, 0.0), speed=1.0), Move(to=(2.0, 2.0), speed=1.0)
    person = person_motion(Person((0.0, 0.0), moves=moves), 1.7, 4)
    pushed = PushedMotion(person, 0.7)
    for time_s in (1.0, 2.0, 3.0):
        position_m, _velocity, heading_rad, _posture = person.at(time_s)
        ahead = np.array([np.cos(heading_rad), np.sin(heading_rad)])
        np.testing.assert_allclose(pushed.at(time_s).position_m, position_m + 0.7 * ahead)
        step_m = pushed.at(time_s + 0.05).position_m - pushed.at(time_s - 0.05).position_m
        np.testing.assert_allclose(pushed.at(time_s).velocity_mps, step_m / 0.1, atol=0.1)
    np.testing.assert_allclose(pushed.at(1.0).velocity_mps, (1, 0), atol=1e-6)
    assert np.hypot(*pushed.at(2.0).velocity_mps) > 1.5  # it swings round


def test_the_ground_truth_has_objects_after_people():
    scenario = Scenario(duration=0.1, rate=10, people=(Person((4.0, 0.5)),),
                        objects=(SceneObject('trolley', pushed_by=1), SceneObject('chair', (3.0, -1.0), facing=0.7)))
    simulator = Simulator(scenario)
    frame = simulator.frame(0)
    assert [(truth.id, truth.label) for truth in frame.truth] == [(1, 'person'), (2, 'trolley'), (3, 'chair')]
    assert [person.label for person in frame.people] == ['person']
    person, trolley, chair = frame.truth
    assert trolley.position_m[0] - person.position_m[0] == pytest.approx(GAP_M + 0.3)
    np.testing.assert_allclose(chair.size_m, (0.45, 0.45, 0.9), atol=1e-6)
    np.testing.assert_allclose(chair.position_m, (3.0, -1.0, 0.45), atol=1e-6)
    x1, y1, x2, y2 = chair.box_px
    assert 100 < x2 - x1 < 160 and 180 < y2 - y1 < 240
    tracks = simulator.true_tracks(frame, 10 ** 9)
    assert [track.label for track in tracks] == ['person', 'trolley', 'chair']
    np.testing.assert_allclose(tracks[1].prediction_m[:, :2], [trolley.position_m[:2]] * 8)
