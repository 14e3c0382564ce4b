"""pipeline.launch in one process: types of images, and live parameters of its nodes.

Needs a master for the client and the command of dynamic_reconfigure.
"""
import ast

import numpy as np
import pytest
import rospy
from dynamic_reconfigure.client import Client
from dynamic_reconfigure.encoding import encode_config
from dynamic_reconfigure.srv import Reconfigure
from rosgraph_msgs.msg import Log
from sensor_msgs.msg import Image
from std_msgs.msg import String

from ros_3d_bb.conversions.image_msgs import imgmsg_to_depth
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.detection.depth.person_clusters import DepthPeopleParams
from ros_3d_bb.detection.detector import DetectorParams
from ros_3d_bb.nodes.common.reconfigure_server import live_in
from ros_3d_bb.nodes.common.subscribers import subscribe
from ros_3d_bb.pipeline.estimation_stage import Bbox3dParams
from ros_3d_bb.pipeline.tracking_stage import TRACKING_PARAMS, TrackerNodeParams
from ros_3d_bb.visualization.markers import MarkerParams
from support.compressed import compressed
from support.ros import TIMEOUT_S, Recorder, depth_message, publisher, wait_until

LIVE = {'bbox3d_node': live_in([Bbox3dParams]),
        'detector_node': live_in([DetectorParams, DepthPeopleParams]),
        'tracker_node': live_in((TrackerNodeParams, MarkerParams) + TRACKING_PARAMS)}
NODES = sorted(LIVE)


def test_the_publisher_decides_the_type_of_images():
    """A message of another type is left out; the diagnostics report such a topic as silent."""
    image, received = depth_message(NS, 2000), {}
    for name, message in (('plain', image), ('other', String('no image')),
                          ('compressed', compressed(image, 'compressedDepth'))):
        received[name] = []
        unsubscribe = subscribe('images/' + name, Image, received[name].append)
        sender = publisher('images/' + name, type(message))
        for _message in range(2):
            sender.publish(message)
        if name != 'other':
            wait_until(lambda: len(received[name]) == 2, name)
        unsubscribe()
        assert [type(each) for each in received[name]] == [type(message)] * (0 if name == 'other' else 2)
    np.testing.assert_array_equal(imgmsg_to_depth(received['compressed'][0]).values, np.full((48, 64), 2000))


@pytest.fixture(scope='module')
def clients():
    created = {node: Client(node, timeout=TIMEOUT_S) for node in NODES}
    yield created
    for client in created.values():
        client.close()


def current(client):
    """The parameters of a node now; `get_configuration` returns the last ones that the client has received."""
    return client.update_configuration({})


@pytest.fixture
def wait_for_line(clients):
    with Recorder('/rosout', Log) as log:
        yield lambda words: wait_until(lambda: any(words in entry.msg for entry in log.messages), words)


def as_text(value):
    """Lists as text, because dynamic_reconfigure has no lists."""
    return ', '.join(value) if isinstance(value, (list, tuple)) else value


@pytest.mark.parametrize('node', NODES)
def test_live_parameters_are_offered_and_each_offered_value_is_accepted(clients, node):
    """Each parameter at both of its limits, or with each of its choices, the others at their defaults."""
    offered = {entry['name']: entry for entry in clients[node].get_parameter_descriptions(TIMEOUT_S)}
    assert set(offered) == set(LIVE[node]) and len(offered) >= 4
    for name, entry in offered.items():
        param, values = LIVE[node][name], [entry['default']]
        assert param.text in entry['description'] and entry['default'] == as_text(param.default)
        if entry['type'] in ('int', 'double'):
            assert entry['min'] <= entry['default'] <= entry['max'] > entry['min']
        if entry['type'] != 'str':
            values = [entry['min'], entry['max']] + values
        elif entry['edit_method']:
            values = [choice['value'] for choice in ast.literal_eval(entry['edit_method'])['enum']] + values
            assert set(values) == set(param.choices)
        for value in values:
            assert clients[node].update_configuration({name: value})[name] == value
            assert as_text(rospy.get_param('/%s/%s' % (node, name))) == value


@pytest.mark.parametrize('node, change, words', [
    ('tracker_node', {'max_age': 1.0, 'outlier_share': 1.5, 'marker_history': 9.0},
     'parameter ~outlier_share is 1.5'),
    ('tracker_node', {'target_frame': 'odom'}, 'parameter ~target_frame is read only at startup'),
    ('tracker_node', {'prediction_step': 1e-6}, 'prediction_step is 1e-06'),
    ('detector_node', {'floor_height': float('nan'), 'min_depth': 1.0}, 'parameter ~floor_height is nan')])
def test_a_request_with_an_invalid_value_is_rejected_as_a_whole(clients, wait_for_line, node, change, words):
    before = current(clients[node])
    response = rospy.ServiceProxy('/%s/set_parameters' % node, Reconfigure)(encode_config(change)).config
    values = {entry.name: entry.value for entry in response.doubles + response.ints + response.strs}
    assert values == {name: value for name, value in before.items() if name != 'groups'}
    wait_for_line(words)
    assert all(as_text(rospy.get_param('/%s/%s' % (node, name))) == value for name, value in values.items())
