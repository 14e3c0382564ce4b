"""Parser of lengths."""
import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ros_3d_bb_annotator.lengths import parse_length


@pytest.mark.parametrize('text,unit,expected_m', [
    ('1230', 'mm', 1.23), ('1230 mm', 'm', 1.23), ('1.23 m', 'mm', 1.23), ('1.23m', 'mm', 1.23), ('1,23', 'm', 1.23),
    ('1,2305', 'mm', 0.001231), ('-650', 'mm', -0.65), ('\u2212650', 'mm', -0.65), (' 12 cm ', 'm', 0.12),
    ('.5', 'm', 0.5), ('2.', 'm', 2.0), ('1,230', 'm', 1.23), ('1.230', 'mm', 0.00123), ('-0', 'mm', 0.0),
    ('0,123', 'mm', 0.000123), ('100000', 'mm', 100.0)])
def test_lengths_are_parsed(text, unit, expected_m):
    assert parse_length(text, unit) == pytest.approx(expected_m, abs=5e-7)
    assert str(parse_length(text, unit)) != '-0.0'


@pytest.mark.parametrize('text,unit,named', [
    ('1,230', 'mm', '1230 mm .*1.230 mm'), ('1,230 mm', 'm', '1230 mm .*1.230 mm'), ('1230', 'm', '1230 m'),
    ('100.1', 'm', '100 m')] + [(text, 'mm', re.escape(repr(text))) for text in (
        '', ' ', 'm', '1 2', '1.2.3', '1,2,3', '1e3', '+ 0', 'nan', 'inf', '1 km', '0x10', '--1', '1 M',
        '__import__("os").getcwd()', '1+1', '(1)', '\u0661', '1_0')])
def test_invalid_and_ambiguous_lengths_are_rejected(text, unit, named):
    with pytest.raises(ValueError, match=named):
        parse_length(text, unit)


@given(st.integers(-100000, 100000))
def test_integer_millimetres_are_restored(value_mm):
    for text, unit in (('%d' % value_mm, 'mm'), ('%d mm' % value_mm, 'm'), ('%.3f' % (value_mm / 1000.0), 'm')):
        assert round(1000 * parse_length(text, unit), 3) == value_mm


@given(st.text(max_size=12))
def test_any_text_is_a_length_or_rejected(text):
    try:
        assert -100 <= parse_length(text, 'mm') <= 100
    except ValueError as error:
        assert 'expected' in str(error) or 'comma' in str(error)
