"""Parser of lengths."""
import re

import pytest

from ros_3d_bb_annotator.lengths import parse_length


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
