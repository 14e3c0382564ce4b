"""Table of a session in the format of the thesis. With ROS_3D_BB_DATA it contains the numbers of the thesis."""
import csv
import os

import pytest

import conftest
from ros_3d_bb.sessions.session_reader import SessionError
from ros_3d_bb_annotator.document import Document
from ros_3d_bb_annotator.export import COLUMNS, export, rows_of
from ros_3d_bb_lab.evaluation.noise.tables import read_table
from support.small_session import change_json


def read_rows(path):
    """The header and the rows as ints."""
    with open(str(path), newline='') as stream:
        header, *rows = csv.reader(stream)
    return header, [tuple(int(cell) for cell in row) for row in rows]


def test_the_table_of_the_session_contains_the_numbers_of_the_thesis(session_folder, tmp_path):
    path = str(tmp_path / 'table.csv')
    document = Document.open(session_folder)
    assert export(document, path) == len(document.measurements)
    header, rows = read_rows(path)
    if conftest.DATA:
        author_header, author_rows = read_rows(os.path.join(session_folder, 'csv', 'new_measurements.csv'))
        assert header == author_header and set(rows) <= set(author_rows)
        # the author's dictionary keeps equal measurements only once
        assert [row for row in author_rows if row in set(rows)] == sorted(set(rows)) and len(set(rows)) == 103
    assert header == list(COLUMNS) and len(read_table(path, 'X').complete().truth_m) == len(document.measurements)
    for index, measurement in enumerate(document.measurements):
        x_m, z_m, _plane_m = document.errors(index)
        assert min(abs(row[4] - 1000 * x_m) + abs(row[6] - 1000 * z_m) for row in rows
                   if row[1] == round(1000 * measurement.truth_m[0])
                   and row[3] == round(1000 * measurement.truth_m[2])) < 2


def test_values_are_integer_millimetres_and_errors_measured_minus_true(document, tmp_path):
    document.set_truth(0, -0.5, 2.1004)
    document.set_truth(1, -0.5, 2.1004)
    document.choose_person(1, 1)
    assert export(document, str(tmp_path / 'table.csv')) == 2
    assert (tmp_path / 'table.csv').read_text() == (
        'X measured,X true,Z measured,Z true,X error,X absolute error,Z error,Z absolute error\n'
        '-466,-500,2000,2100,34,34,-100,100\n700,-500,3000,2100,1200,1200,900,900\n')


def test_only_annotated_measurements_with_an_estimate_are_exported(document, tmp_path):
    for index in range(3):
        document.set_truth(index, 0.0, 2.0)
    document.reject(1, 'blurred')
    change_json(str(tmp_path), lambda content: content['frames'][2].update(detections=[]))
    document.refresh()
    assert len(rows_of(document)) == 1


def test_an_empty_table_or_an_unwritable_file_raises_an_error(document, tmp_path):
    with pytest.raises(SessionError, match=str(tmp_path)):
        export(document, str(tmp_path / 'table.csv'))
    document.set_truth(0, 0.0, 2.0)
    with pytest.raises(SessionError, match=str(tmp_path)):
        export(document, str(tmp_path / 'missing' / 'table.csv'))
    assert not os.path.exists(str(tmp_path / 'table.csv'))
