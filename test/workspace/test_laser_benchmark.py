"""Which lethal cells of the laser benchmark count as those of people."""
import numpy as np

from ros_3d_bb_lab.evaluation.costmap.costmap_score import Costmap
from ros_3d_bb_lab.evaluation.costmap.laser_benchmark import counts_of
from ros_3d_bb_lab.simulation.scenario import Furniture, Room

ROOM = Room(bounds=(-3.0, 5.0, -4.0, 4.0), furniture=(Furniture(at=(2.0, 2.0), size=(1.0, 1.0, 1.0)),))


def test_cells_at_walls_and_furniture_are_those_of_the_room():
    lethal = np.zeros((160, 160), bool)
    origin_m, cell_m = np.array([-3.0, -4.0]), 0.05
    for x, y in ((4.95, 0.0), (2.0, 1.45), (2.0, 2.0), (3.0, 0.0)):  # a wall, furniture twice, a person
        column, row = ((np.array([x, y]) - origin_m) / cell_m).astype(int)
        lethal[row, column] = True
    assert counts_of(Costmap(0.0, lethal, origin_m, cell_m, np.eye(4)), ROOM) == (1, 3)
    assert counts_of(Costmap(0.0, lethal & False, origin_m, cell_m, np.eye(4)), ROOM) == (0, 0)
