"""The pages of nodes and launch files are what the code says, and the nodes do what their docstrings say."""
import contextlib
import functools
import os
import sys
from unittest import mock

import pytest

from fuzz import hostile
from fuzz.nodes import TARGETS
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.nodes.realsense_node import RealSenseNode
from ros_3d_bb.tracking.thesis_tracker import ThesisTrackerParams
from ros_3d_bb_lab.evaluation.latency.latency_probe_node import LatencyProbeNode
from ros_3d_bb_lab.evaluation.latency.replay_node import ReplayNode
from ros_3d_bb_lab.simulation.ros.simulator_node import SimulatorNode
from support.masterless import masterless
from support.planner_definitions import package
from support.pages import DOC, ROOT, node_pages

NODES = {node.name: node for node in node_pages.nodes()}
SCENARIO = os.path.join(ROOT, 'config', 'scenarios', 'empty_room.yaml')
# What makes each node connect to all that it may connect to; the others as the fuzzer makes them.
MORE_PARAMS = {'planner_bridge_node': {'outputs': 'costmap, people, teb, mpc, vision'},
               'realsense_node': {'publish_clock': True}, 'replay_node': {'boxes': True},
               'simulator_node': {'scenario': SCENARIO, 'publish_clock': True}}
OTHERS = {'realsense_node': RealSenseNode, 'replay_node': ReplayNode, 'simulator_node': SimulatorNode,
          'latency_probe_node': LatencyProbeNode}
OPTIONAL_PACKAGES = 'people_msgs', 'costmap_converter', 'derived_object_msgs', 'vision_msgs'


@contextlib.contextmanager
def connected(name):
    """The connections of a node that was made and has had the images and boxes of one stamp; no thread runs."""
    stand_ins = {optional + '.msg': package(optional) for optional in OPTIONAL_PACKAGES}
    if name in OTHERS:
        params, make = {}, OTHERS[name]
    else:
        params, make = TARGETS[name].params, functools.partial(TARGETS[name].make, None)
    with masterless(dict(params, **MORE_PARAMS.get(name, {}))) as connections, \
            mock.patch.dict(sys.modules, stand_ins), mock.patch('threading.Thread.start'), \
            mock.patch('ros_3d_bb_lab.evaluation.latency.replay_node.images_in', lambda _path, _topics: []):
        node = make()
        messages = dict(hostile.good_frame(NS), yolo_bounding_box=hostile.good_boxes(NS))
        for topic in sorted(set(messages) & set(connections.subscribers)):
            connections.send(topic, messages[topic])
        yield node, connections


def told(name, section):
    """{name: type} of what docstrings tell; diagnostic_updater is stood in for."""
    return {entry.name: entry.kind for entry in NODES[name].sections.get(section, ()) if entry.name != '/diagnostics'}


def test_there_are_pages_of_all_nodes():
    scripts = set(name for name in os.listdir(os.path.join(ROOT, 'scripts')) if name.endswith('_node'))
    assert set(NODES) == scripts == set(TARGETS) | set(OTHERS)


@pytest.mark.parametrize('path', sorted(node_pages.pages()))
def test_pages_and_parameter_files_are_those_that_are_made_of_the_code(path):
    with open(os.path.join(ROOT, path), encoding='utf-8') as stream:
        assert stream.read() == node_pages.pages()[path], 'out of date: ./run doc makes it anew'


def test_no_page_is_left_of_a_node_that_is_gone():
    made = set(os.path.basename(path) for path in node_pages.pages() if path.startswith('doc/nodes'))
    assert set(os.listdir(os.path.join(DOC, 'nodes'))) == made


@pytest.mark.parametrize('name', sorted(NODES))
def test_a_node_connects_to_the_topics_and_services_that_its_docstring_names(name):
    with connected(name) as (_node, connections):
        for section, found in (('Subscribes', connections.subscribers), ('Publishes', connections.publishers)):
            # one is beside another, and so resolved by the node
            assert {topic.lstrip('/'): connection.kind._type for topic, connection in found.items()} == {
                topic.lstrip('/'): kind for topic, kind in told(name, section).items()}
        assert {service: kind._type for service, kind in connections.services.items()} == told(name, 'Services')


@pytest.mark.parametrize('name', sorted(NODES))
def test_the_services_that_a_node_calls_are_named(name):
    with connected(name) as (node, _connections), mock.patch('rospy.ServiceProxy') as proxy:
        if hasattr(node, 'pause_or_resume'):
            node.pause_or_resume()
        assert {call[0][0]: call[0][1]._type for call in proxy.call_args_list} == told(name, 'Calls')


def test_parameters_are_those_of_the_node_each_with_its_default_and_what_it_is_for():
    parameters = {parameter.name: parameter for parameter in node_pages.parameters_of(NODES['tracker_node'])}
    assert len(parameters) == sum(
        len(set(kind._fields)) for kind in node_pages.parameter_types(NODES['tracker_node'].node_class)) - 3  # shared
    assert parameters['alpha'] == node_pages.Parameter(
        'alpha', 'float', '0.2', ThesisTrackerParams.PARAMS['alpha'].text, 'Allowed: 1e-06 to 1. Live: 0.01 to 1.',
        'thesis')
    assert parameters['target_frame'].default == 'map'
    assert parameters['target_frame'].meaning.endswith('(`frame_world:=`)')


def test_a_parameter_that_nobody_describes_is_an_error():
    node = NODES['tracker_node']
    with mock.patch.object(node_pages, 'launch_meaning', lambda _node, _parameter: None):
        with pytest.raises(ValueError, match='target_frame'):
            node_pages.parameters_of(node)
