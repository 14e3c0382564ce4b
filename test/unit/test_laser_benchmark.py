"""The simulated laser, and which lethal cells count as those of people."""
import numpy as np
import pytest

from ros_3d_bb_lab.evaluation.costmap.costmap_score import Costmap
from ros_3d_bb_lab.evaluation.costmap.laser_benchmark import BEAMS, FIELD_OF_VIEW, counts_of, scan_ranges
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


def test_walls_out_of_range_give_no_return():
    assert scan_ranges((0.0, 0.0, 0.0), ROOM._replace(bounds=(-3.0, 12.0, -4.0, 4.0)), [], [])[AHEAD] == np.inf


def test_cells_at_walls_and_furniture_are_those_of_the_room():
    lethal = np.zeros((160, 160), bool)
    origin_m, cell_m = np.array([-3.0, -4.0]), 0.05
    for x, y in ((4.95, 0.0), (2.0, 1.45), (2.0, 2.0), (3.0, 0.0)):  # a wall, furniture twice, a person
        column, row = ((np.array([x, y]) - origin_m) / cell_m).astype(int)
        lethal[row, column] = True
    assert counts_of(Costmap(0.0, lethal, origin_m, cell_m, np.eye(4)), ROOM) == (1, 3)
    assert counts_of(Costmap(0.0, lethal & False, origin_m, cell_m, np.eye(4)), ROOM) == (0, 0)
