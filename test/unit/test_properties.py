"""Any text is YAML or rejected, and any value is a parameter of the right type or rejected, by one kind of error."""

import pytest
import yaml
from hypothesis import given, strategies as st

from ros_3d_bb.core.params import params_from
from ros_3d_bb.core.yaml_loader import load_yaml
from ros_3d_bb.detection.depth.person_clusters import DepthPeopleParams

PLAIN = st.recursive(st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text(),
                     lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner), max_leaves=20)


@given(st.text())
def test_any_text_is_yaml_or_rejected(text):
    try:
        load_yaml(text)
    except yaml.YAMLError:
        pass


@pytest.mark.slow
@given(st.dictionaries(st.sampled_from(DepthPeopleParams._fields) | st.text(), PLAIN, max_size=3))
def test_parameters_have_their_types_or_are_rejected(given_params):
    try:
        params, = params_from(given_params, DepthPeopleParams)
    except ValueError:
        return
    for name, kind in DepthPeopleParams.__annotations__.items():
        assert isinstance(getattr(params, name), kind)
