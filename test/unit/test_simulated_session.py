"""Simulated measurement sessions agree with their ground truth."""
import numpy as np
import pytest

from ros_3d_bb.sessions.session_reader import read_session
from ros_3d_bb_lab.evaluation.noise.tables import read_session_measurements
from ros_3d_bb_lab.evaluation.simulated_session import write_simulated_session


@pytest.mark.slow
def test_measured_positions_agree_with_the_truth(tmp_path):
    session = read_session(write_simulated_session(str(tmp_path), (3.0,), (0.0, 0.2), repetitions=2))
    assert [frame.truth_m.tolist() for frame in session.frames] == [[0, 3], [0, 3], [0.6, 3], [0.6, 3]]
    measured = read_session_measurements(str(tmp_path), 'foreground')
    assert np.abs(measured.measured_m[:, [0, 2]] - measured.truth_m).max() < 0.3
    assert [frame.boxes_px[0][0] for frame in session.frames[:2]] != pytest.approx(
        [frame.boxes_px[0][0] for frame in session.frames[2:]], abs=50)
