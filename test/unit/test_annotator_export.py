"""Table of a session as CSV."""
import csv

import pytest

from ros_3d_bb_annotator.export import export
from ros_3d_bb_lab.evaluation.noise.tables import read_table
from support.small_session import NEAR_BOX


def test_a_row_contains_box_estimates_and_truth_in_all_axes(document, tmp_path):
    document.set_truths([0], -0.5, 2.1004, 0.01)
    path = str(tmp_path / 'table.csv')
    assert export(document, path, 'foreground') == 1
    with open(path, newline='') as stream:
        row, = csv.DictReader(stream)
    x_m, y_m, z_m = document.estimated(0, NEAR_BOX).center_m
    assert (row['id'], row['label'], row['stamp']) == ('m0', 'by the door', '1616161616.000000005')
    assert [int(row[edge]) for edge in ('x1', 'y1', 'x2', 'y2')] == list(NEAR_BOX) and row['implausible'] == ''
    assert [float(row[axis + ' measured']) for axis in 'XYZ'] == pytest.approx(
        [1000 * x_m, 1000 * y_m, 1000 * z_m], abs=0.06)
    assert [float(row[axis + ' recorded']) for axis in 'XYZ'] == [-466.5, 33, 2000]
    assert [float(row[axis + ' true']) for axis in 'XYZ'] == [-500, 10, 2100.4]
    assert float(row['Z error']) == pytest.approx(1000 * z_m - 2100.4, abs=0.06)
    assert read_table(path, 'Z').truth_m.tolist() == [[-0.5, 2.1004]]
