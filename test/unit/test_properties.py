"""Laws that hold whatever comes: what is written is read, and what is wrong is refused by one kind of error."""
import json
from types import SimpleNamespace

import numpy as np
import pytest
import yaml
from hypothesis import given, strategies as st

from ros_3d_bb.conversions.image_msgs import LAYOUTS, array_from, fill_image, imgmsg_to_depth, imgmsg_to_rgb
from ros_3d_bb.core.params import params_from
from ros_3d_bb.core.yaml_loader import load_yaml
from ros_3d_bb.detection.depth.person_clusters import DepthPeopleParams
from ros_3d_bb.sessions.session_reader import SessionError, read_session
from ros_3d_bb_lab.simulation.scenario import scenario_from

PLAIN = st.recursive(st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text(),
                     lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner), max_leaves=20)
IMAGES = st.builds(SimpleNamespace, width=st.integers(0, 2 ** 32 - 1) | st.integers(0, 9),
                   height=st.integers(0, 2 ** 32 - 1) | st.integers(0, 9),
                   step=st.integers(0, 2 ** 32 - 1) | st.integers(0, 40),
                   encoding=st.sampled_from(sorted(LAYOUTS)) | st.text(),
                   is_bigendian=st.integers(0, 255), data=st.binary(max_size=400))


@given(IMAGES)
def test_an_image_has_its_pixels_or_is_refused(message):
    for read in (array_from, imgmsg_to_rgb, lambda image: imgmsg_to_depth(image).values):
        try:
            pixels = read(message)
        except ValueError:
            continue
        assert pixels.shape[:2] == (message.height, message.width)
        pixels.sum()  # each of them can be read


@given(st.sampled_from(sorted(LAYOUTS)), st.integers(1, 9), st.integers(1, 9), st.integers(0, 255))
def test_pixels_survive_an_image_message_and_a_byte_less_is_refused(encoding, height, width, value):
    kind, channels = LAYOUTS[encoding]
    pixels = np.full((height, width) + ((channels,) if channels > 1 else ()), value, kind)
    message = fill_image(SimpleNamespace(), pixels, encoding)
    np.testing.assert_array_equal(array_from(message), pixels)
    message.data = message.data[:-1]
    with pytest.raises(ValueError, match='too short'):
        array_from(message)


@pytest.mark.slow
@given(PLAIN)
def test_yaml_gives_back_plain_data(content):
    content = json.loads(json.dumps(content))  # no list in it is another one, for which YAML would write an alias
    assert load_yaml(yaml.safe_dump(content)) == content


@given(st.text())
def test_any_text_is_yaml_or_refused(text):
    try:
        load_yaml(text)
    except yaml.YAMLError:
        pass


@pytest.mark.slow
@given(st.dictionaries(st.sampled_from(DepthPeopleParams._fields) | st.text(), PLAIN, max_size=3))
def test_parameters_have_their_types_or_are_refused(given_params):
    try:
        params, = params_from(given_params, DepthPeopleParams)
    except ValueError:
        return
    for name, kind in DepthPeopleParams.__annotations__.items():
        assert isinstance(getattr(params, name), kind)


@given(PLAIN)
def test_any_json_is_a_session_or_refused(tmp_path_factory, content):
    folder = tmp_path_factory.mktemp('session')
    for shaped in (content, {'camera': content, 'frames': []}, {'frames': [content]}):
        (folder / 'frames.json').write_text(json.dumps(shaped))
        with pytest.raises(SessionError):
            read_session(str(folder))


@given(st.dictionaries(st.sampled_from(('duration', 'rate', 'seed', 'room', 'robot', 'people')), PLAIN, max_size=3))
def test_any_content_is_a_scenario_or_refused(content):
    try:
        scenario_from(content)
    except ValueError:
        pass
