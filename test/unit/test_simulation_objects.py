"""Objects other than people in the simulator, and their ground truth."""
import numpy as np
import pytest

from ros_3d_bb_lab.simulation.scenario import Person, SceneObject, Scenario
from ros_3d_bb_lab.simulation.scene_objects import GAP_M
from ros_3d_bb_lab.simulation.simulator import Simulator


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
