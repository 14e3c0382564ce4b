"""Plausibility of truth: slips are found, and clean measurements are not questioned."""
import numpy as np
import pytest

from ros_3d_bb.sessions.plausibility import FACTORS, likely_errors
from ros_3d_bb_lab.evaluation.noise.tables import read_session_measurements

SLIP_M = 0.3 + 1e-9  # larger slips must be found


@pytest.fixture(scope='module', params=['foreground', 'recorded'])
def table(request, session_folder):
    return read_session_measurements(session_folder, request.param)


def positions_of(table):
    return table.measured_m[:, [0, 2]], table.truth_m


def slips_of(truth_m, marks_m):
    """True positions (x, z) that a slip could turn into others: digits lost, units, sign, next marks."""
    for axis in (0, 1):
        digits = '%d' % round(1000 * abs(truth_m[axis]))
        values_mm = [float(digits[:place] + digits[place + 1:] or 0) for place in range(len(digits))]
        for value_m in [np.copysign(value_mm / 1000, truth_m[axis]) for value_mm in values_mm] + [
                factor * truth_m[axis] for factor in FACTORS]:
            yield np.where(np.arange(2) == axis, value_m, truth_m)
    yield from (factor * truth_m for factor in FACTORS)
    yield truth_m * (-1, 1)
    yield from marks_m


def test_every_slip_of_more_than_0_3_m_is_found_and_no_true_position_is(table):
    measured_m, truth_m = positions_of(table)
    marks_m, count = np.unique(truth_m, axis=0), 0
    for number in range(len(truth_m)):
        others = np.arange(len(truth_m)) != number
        likely = likely_errors(measured_m[others], truth_m[others])
        assert likely.are_plausible(measured_m[number], truth_m[number])
        slips_m = np.array([slip_m for slip_m in slips_of(truth_m[number], marks_m)
                            if np.hypot(*(slip_m - truth_m[number])) > SLIP_M])
        missed = likely.are_plausible(np.broadcast_to(measured_m[number], slips_m.shape), slips_m)
        assert not missed.any(), (truth_m[number], slips_m[missed])
        count += len(slips_m)
    assert count > 25 * len(truth_m)


def made(count, seed=0, noise_m=0.01):
    """Measured and true positions with the errors 0.1 - 0.05 z in z and -0.1 x in x."""
    random = np.random.RandomState(seed)
    truth_m = np.stack((random.uniform(-1, 1, count), random.uniform(1, 4, count)), axis=1)
    error_m = np.stack((-0.1 * truth_m[:, 0], 0.1 - 0.05 * truth_m[:, 1]), axis=1)
    return truth_m + error_m + noise_m * random.normal(size=truth_m.shape), truth_m


@pytest.mark.parametrize('factors', [(1, 0.001), (0.001, 0.001), (1, 10), (0.01, 1), (-1, 1)])
def test_the_position_before_a_slip_is_recognised(factors):
    truth_m = np.array([0.6, 2.5])
    slip_m = truth_m * factors
    likely = likely_errors(*made(60))
    assert not likely.are_plausible([0.54, 2.475], slip_m)
    assert likely.corrected_slip([0.54, 2.475], slip_m) == pytest.approx(truth_m)
    assert likely.corrected_slip([0.54, 2.475], (0.1, 3.9)) is None
