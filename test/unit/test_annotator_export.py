"""Table of a session in the format of the thesis. With ROS_3D_BB_DATA it contains the numbers of the thesis."""
import csv
import os

import pytest

import conftest
from ros_3d_bb_annotator.document import Document
from ros_3d_bb_annotator.export import THESIS_COLUMNS, export
from ros_3d_bb_lab.evaluation.noise.tables import read_table
from support.small_session import NEAR_BOX


def read_rows(path):
    """The header and the rows as ints."""
    with open(str(path), newline='') as stream:
        header, *rows = csv.reader(stream)
    return header, [tuple(int(cell) for cell in row) for row in rows]


def test_the_table_of_the_session_contains_the_numbers_of_the_thesis(session_folder, tmp_path):
    path = str(tmp_path / 'table.csv')
    document = Document.open(session_folder)
    assert export(document, path, 'recorded', in_thesis_form=True) == len(document.measurements)
    header, rows = read_rows(path)
    if conftest.DATA:
        author_header, author_rows = read_rows(os.path.join(session_folder, 'csv', 'new_measurements.csv'))
        assert header == author_header and set(rows) <= set(author_rows)
        # the author's dictionary keeps equal measurements only once
        assert [row for row in author_rows if row in set(rows)] == sorted(set(rows)) and len(set(rows)) == 103
    assert header == list(THESIS_COLUMNS)
    assert len(read_table(path, 'X').complete().truth_m) == len(document.measurements)


def test_a_row_contains_box_estimates_and_truth_in_all_axes(document, tmp_path):
    document.set_truth(0, -0.5, 2.1004, 0.01)
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
