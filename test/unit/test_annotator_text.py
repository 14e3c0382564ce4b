import re

import pytest

from ros_3d_bb_annotator.lengths import parse_length
from ros_3d_bb_annotator.marks import Mark, parse_marks

MARKS = (Mark('A1', -0.6, 1.5), Mark('B1', 0.0, 1.5))


@pytest.mark.parametrize('text', [
    'A1, -600, 1500\nB1, 0, 1500', 'name,x,z\n"A1",-600,1500\n\n"B1",0,1500\n', 'A1\t-600\t1500\r\nB1\t0\t1500',
    'A1;-0,6 m;1,5 m\nB1;0;1500', 'Mark X Z\nA1 -60cm 150cm\nB1 0 1.5m'])
def test_tables_are_parsed(text):
    assert parse_marks(text) == MARKS


def test_marks_whose_names_begin_as_a_header_are_kept():
    marks = parse_marks('Name;X;Z\nMark 1;-600;1500\nLabel B;0;1500')
    assert marks == parse_marks('Mark 1;-600;1500\nLabel B;0;1500')
    assert [mark.name for mark in marks] == ['Mark 1', 'Label B']


@pytest.mark.parametrize('text,named', [
    ('A1, -600', 'line 1 is'), ('A1, -600, 1500\nB1, far, 1500', "line 2: 'far' is not a length"),
    ('A1, 0, 0', 'line 1: Z is 0 mm; at least 50 mm'),
    (', 0, 1500', 'line 1: the name is empty'), ('A1, 0, 1500\na1, 0, 2000', 'a1 is not unique'),
    ('Name, X [m], Z [m]\nA1, -0.6, 1.5', 'line 2: Z is 1.5 mm; at least 50 mm')])
def test_invalid_tables_are_rejected(text, named):
    with pytest.raises(ValueError, match=named):
        parse_marks(text)


@pytest.mark.parametrize('text,expected_m', [
    ('1230', 1.23), ('1.23m', 1.23), ('1,23 m', 1.23), ('1,2305', 0.001231), ('\u2212650', -0.65), (' 12 cm ', 0.12),
    ('.5m', 0.5), ('1,230 m', 1.23), ('1.230', 0.00123), ('-0', 0.0), ('100000', 100.0)])
def test_lengths_are_parsed(text, expected_m):
    assert parse_length(text) == pytest.approx(expected_m, abs=5e-7)
    assert str(parse_length(text)) != '-0.0'


@pytest.mark.parametrize('text,named', [
    ('1,230', '1230 mm .*1.230 mm'), ('100.1m', '100 m')]
    + [(text, re.escape(repr(text))) for text in ('', 'm', '1 2', '1.2.3', '1e3', 'nan', '1 km', '\u0661', '1_0')])
def test_invalid_and_ambiguous_lengths_are_rejected(text, named):
    with pytest.raises(ValueError, match=named):
        parse_length(text)
