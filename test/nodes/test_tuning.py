"""Parameters of running nodes by dynamic_reconfigure's own client and command. Needs a master because those do."""
import ast
import subprocess

import pytest
import rospy
from dynamic_reconfigure.client import Client
from dynamic_reconfigure.encoding import encode_config
from dynamic_reconfigure.msg import Config
from dynamic_reconfigure.srv import Reconfigure
from rosgraph_msgs.msg import Log

from ros_3d_bb.detection.depth.person_clusters import DepthPeopleParams
from ros_3d_bb.nodes.common.reconfigure_server import live_in
from ros_3d_bb.pipeline.detection_stage import DepthDetectorParams
from ros_3d_bb.pipeline.estimation_stage import Bbox3dParams
from ros_3d_bb.pipeline.tracking_stage import TRACKING_PARAMS, TrackerNodeParams
from ros_3d_bb.visualization.markers import MarkerParams
from support.ros import TIMEOUT_S, Recorder, wait_until

LIVE = {'bbox3d_node': live_in([Bbox3dParams]),
        'depth_detector_node': live_in([DepthDetectorParams, DepthPeopleParams]),
        'tracker_node': live_in((TrackerNodeParams, MarkerParams) + TRACKING_PARAMS)}
NODES = sorted(LIVE)


@pytest.fixture(scope='module')
def clients():
    """dynamic_reconfigure's client of each node."""
    rospy.init_node('test_tuning')
    made = {node: Client(node, timeout=TIMEOUT_S) for node in NODES}
    yield made
    for client in made.values():
        client.close()


def in_force(client):
    """What a node answers now: `get_configuration` returns what it published last, as far as it has come here."""
    return client.update_configuration({})


@pytest.fixture
def tracker(clients):
    """The tracker's client; afterwards all is as it was."""
    client = clients['tracker_node']
    values = in_force(client)
    before = {name: values[name] for name in LIVE['tracker_node']}
    yield client
    client.update_configuration(before)


@pytest.fixture
def said(clients):
    """What the nodes say."""
    with Recorder('/rosout', Log) as log:
        yield lambda words: wait_until(lambda: any(words in entry.msg for entry in log.messages), words)


@pytest.mark.parametrize('node', NODES)
def test_what_is_offered_is_what_the_table_says(clients, node):
    expected = LIVE[node]
    offered = {entry['name']: entry for entry in clients[node].get_parameter_descriptions(TIMEOUT_S)}
    assert set(offered) == set(expected) and len(expected) >= 4
    for name, entry in offered.items():
        assert expected[name].text in entry['description']
        default = expected[name].default
        assert entry['default'] == (', '.join(default) if isinstance(default, tuple) else default)
        assert entry['type'] in ('bool', 'str') or entry['min'] <= entry['default'] <= entry['max'] > entry['min']


@pytest.mark.parametrize('node', NODES)
def test_no_slider_reaches_a_value_that_is_refused(clients, node):
    """Each parameter at both of its limits, or with each of its words, the others at their defaults."""
    client = clients[node]
    for entry in client.get_parameter_descriptions(TIMEOUT_S):
        values = [entry['min'], entry['max']] if entry['type'] != 'str' else [
            word['value'] for word in (ast.literal_eval(entry['edit_method'])['enum'] if entry['edit_method'] else [])]
        assert not entry['edit_method'] or entry['default'] in values
        for value in values + [entry['default']]:
            assert client.update_configuration({entry['name']: value})[entry['name']] == value
            given = rospy.get_param('/%s/%s' % (node, entry['name']))
            assert value == (', '.join(given) if isinstance(given, list) else given)


def test_values_are_found_in_the_groups_where_rqt_reconfigure_looks_for_them(tracker):
    groups = in_force(tracker)['groups']['groups']
    sections = {name: parameter.section for name, parameter in LIVE['tracker_node'].items()}
    assert set(groups) == set(sections.values()) and len(groups) > 5
    for name, section in sections.items():
        assert name in groups[section]
    assert groups['thesis']['alpha'] == 0.2 and groups['both trackers']['prediction_time'] == 2.0


def test_a_value_that_makes_no_sense_is_refused_with_all_that_came_with_it(tracker, said):
    before = in_force(tracker)
    with Recorder('/tracker_node/parameter_updates', Config) as updates:
        known = len(updates.wait_for(1))
        answer = tracker.update_configuration({'max_missed_time': 1.0, 'outlier_share': 1.5, 'marker_history': 9.0})
        updates.wait_for(known + 1)  # sliders go back
    assert answer == before
    said('parameter ~outlier_share is 1.5')
    kept = [rospy.get_param('/tracker_node/' + name) for name in ('max_missed_time', 'outlier_share', 'marker_history')]
    assert kept == [0.35, 0.1, 4.0]


@pytest.mark.parametrize('node, change, words', [
    ('tracker_node', {'target_frame': 'odom'},
     'parameter ~target_frame is read at the start only; those that can be changed: accel'),
    ('tracker_node', {'max_aeg': 1.0}, 'unknown parameter ~max_aeg; did you mean ~max_age?'),
    ('tracker_node', {'min_hits': 2.5}, 'parameter ~min_hits is 2.5, a float; int expected'),
    ('tracker_node', {'marker_namespaces': 'cylinder, elipse'},
     "parameter ~marker_namespaces has 'elipse'; did you mean ellipse?"),
    ('tracker_node', {'prediction_step': 1e-6},
     'prediction_step is 1e-06 and prediction_time 2; at most 1000 steps expected'),
    ('tracker_node', {'max_age': float('nan')}, 'parameter ~max_age is nan'),
    ('tracker_node', {'alpha': 7.0}, 'parameter ~alpha is 7'),  # of the tracker not in use
    ('depth_detector_node', {'min_depth': 7.0}, 'min_depth is 7 '),
    ('depth_detector_node', {'floor_height': float('nan'), 'min_depth': 1.0}, 'parameter ~floor_height is nan'),
    ('bbox3d_node', {'estimator': 'mean'}, "parameter ~estimator has 'mean'"),
    ('bbox3d_node', {'stride': 0}, 'parameter ~stride is 0')])
def test_requests_that_make_no_sense_are_refused_with_the_reason(clients, said, node, change, words):
    before = in_force(clients[node])
    answer = rospy.ServiceProxy('/%s/set_parameters' % node, Reconfigure)(encode_config(change)).config
    assert {entry.name: entry.value for entry in answer.doubles + answer.ints + answer.strs} == {
        name: value for name, value in before.items() if name != 'groups'}
    said(words)


def test_lists_stay_lists_on_the_parameter_server(tracker):
    tracker.update_configuration({'marker_namespaces': 'cylinder, id'})
    assert rospy.get_param('/tracker_node/marker_namespaces') == ['cylinder', 'id']


def test_a_node_without_a_parameter_file_is_tuned_too(clients):
    client = Client('plain_tracker', timeout=TIMEOUT_S)
    assert client.update_configuration({'prediction_time': 3.0})['prediction_time'] == 3.0
    assert isinstance(rospy.get_param('/plain_tracker/marker_namespaces'), list)
    client.close()


def test_the_command_of_dynamic_reconfigure_works(tracker, said):
    def dynparam(*arguments):
        command = ('rosrun', 'dynamic_reconfigure', 'dynparam') + arguments
        return subprocess.check_output(command, stderr=subprocess.STDOUT, universal_newlines=True, timeout=TIMEOUT_S)
    assert dynparam('list').split() == ['/' + node for node in sorted(NODES + ['plain_tracker'])]
    dynparam('set', '/tracker_node', 'prediction_time', '3.0')
    said('~prediction_time is 3.0 now, 2.0 before')
    assert rospy.get_param('/tracker_node/prediction_time') == 3.0
    assert "'prediction_time': 3.0" in dynparam('get', '/tracker_node')
