"""The planar laser of the simulator."""
import numpy as np
import pytest

from ros_3d_bb_lab.simulation.laser import BEAMS, FIELD_OF_VIEW, scan_ranges
from ros_3d_bb_lab.simulation.scenario import Furniture, Room

ROOM = Room(bounds=(-3.0, 5.0, -4.0, 4.0), furniture=(Furniture(at=(2.0, 2.0), size=(1.0, 1.0, 1.0)),))
AHEAD = BEAMS // 2


def beam(ranges_m, angle):
    return ranges_m[int(round((angle + FIELD_OF_VIEW / 2) / FIELD_OF_VIEW * (BEAMS - 1)))]


def test_beams_end_at_walls_furniture_and_people():
    ranges_m = scan_ranges((0.0, 0.0, 0.0), ROOM, [[3.0, 0.0]], [0.25])
    assert ranges_m[AHEAD] == pytest.approx(2.75)
    assert beam(ranges_m, np.pi / 2) == pytest.approx(4.0) and beam(ranges_m, -np.pi / 4) == pytest.approx(32 ** .5)
    assert beam(ranges_m, np.pi / 4) == pytest.approx(1.5 * 2 ** .5)
    assert scan_ranges((0.0, 0.0, 0.0), ROOM, [[-2.0, 0.0]], [0.25])[AHEAD] == pytest.approx(5.0)
    assert scan_ranges((0.0, 0.0, np.pi), ROOM, [], [])[AHEAD] == pytest.approx(3.0)
