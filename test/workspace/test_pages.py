import contextlib
import functools
import os
import subprocess
import sys
from unittest import mock

import pytest

from fuzz.nodes import TARGETS, send_image
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.nodes.people_node import PeopleNode
from ros_3d_bb.nodes.realsense_node import RealSenseNode
from ros_3d_bb_lab.evaluation.latency.latency_probe_node import LatencyProbeNode
from ros_3d_bb_lab.evaluation.latency.replay_node import ReplayNode
from ros_3d_bb_lab.evaluation.navigation.navigation_trial_node import NavigationTrialNode
from ros_3d_bb_lab.simulation.ros.simulator_node import SimulatorNode
from support.masterless import masterless
from support.pages import DOC, ROOT, node_pages
from support.planner_definitions import package

CONFIG = node_pages.config_files()
NODES = {node.name: node for node in node_pages.nodes()}
SCENARIO = os.path.join(ROOT, 'config', 'scenarios', 'empty_room.yaml')
# Parameters with which nodes connect to all their topics; the other nodes are created as by the fuzzer.
MORE_PARAMS = {'planner_bridge_node': {'outputs': 'costmap, people, teb, mpc, vision'},
               'tracker_node': {'use_map': True}, 'speed_limit_node': {'use_scan': True},
               'realsense_node': {'publish_clock': True}, 'replay_node': {'boxes': True},
               'navigation_trial_node': dict(scenario=SCENARIO, tracks=True, boxes=True, cloud=True, visible=True,
                                             scan=True),
               'simulator_node': {'scenario': SCENARIO, 'drive': True, 'boxes': True, 'supervised': True}}
OTHERS = {'realsense_node': RealSenseNode, 'replay_node': ReplayNode, 'simulator_node': SimulatorNode,
          'latency_probe_node': LatencyProbeNode, 'navigation_trial_node': NavigationTrialNode,
          'people_node': PeopleNode}
OPTIONAL_PACKAGES = 'people_msgs', 'costmap_converter', 'derived_object_msgs', 'vision_msgs'


@contextlib.contextmanager
def connected(name):
    """A node that has received images and boxes of one stamp, and its connections; no thread runs."""
    stand_ins = {optional + '.msg': package(optional) for optional in OPTIONAL_PACKAGES}
    if name in OTHERS:
        params, make = {}, OTHERS[name]
    else:
        params, make = TARGETS[name].params, functools.partial(TARGETS[name].make, None)
    with masterless(dict(params, **MORE_PARAMS.get(name, {}))) as connections, \
            mock.patch.dict(sys.modules, stand_ins), mock.patch('threading.Thread.start'), \
            mock.patch('ros_3d_bb_lab.evaluation.latency.replay_node.images_in', lambda _path, _topics: []):
        node = make()
        send_image(connections, NS)
        yield node, connections


def documented(name, section):
    """{name: type} in the docstrings."""
    return {entry.name: entry.kind for entry in NODES[name].sections.get(section, ())}


def test_each_node_has_a_script():
    scripts = set(name for name in os.listdir(os.path.join(ROOT, 'scripts')) if name.endswith('_node'))
    assert set(NODES) == scripts == set(TARGETS) | set(OTHERS)


@pytest.mark.parametrize('path', sorted(CONFIG))
def test_parameter_files_are_up_to_date(path):
    with open(os.path.join(ROOT, path), encoding='utf-8') as stream:
        assert stream.read() == CONFIG[path], 'outdated; write it with ./run doc'


@pytest.mark.parametrize('name', [pytest.param(name, marks=pytest.mark.needs('pyrealsense2'))
                                  if name == 'realsense_node' else name
                                  for name in sorted(set(NODES) - {'people_node'})])  # which connects as its parts do
def test_a_node_connects_to_the_topics_and_services_of_its_docstring(name):
    with connected(name) as (node, connections), mock.patch('rospy.ServiceProxy') as proxy:
        for section, found in (('Subscribes', connections.subscribers), ('Publishes', connections.publishers)):
            # the node resolves the name of a topic in the namespace of another one
            # images are subscribed with any type, see `subscribers.subscribe`
            types = {topic.lstrip('/'): connection.kind._type.replace('*', 'sensor_msgs/Image')
                     for topic, connection in found.items()}
            assert types == {
                topic.lstrip('/'): kind for topic, kind in documented(name, section).items()}
        assert {service: kind._type for service, kind in connections.services.items()} == documented(name, 'Services')
        if hasattr(node, 'pause_or_resume'):
            node.pause_or_resume()
        assert {call[0][0]: call[0][1]._type for call in proxy.call_args_list} == documented(name, 'Calls')


@pytest.mark.slow
@pytest.mark.needs('sphinx')
def test_the_site_has_every_page_and_each_link_has_a_target(tmp_path):
    """Others are errors of Sphinx."""
    node_pages.main()
    subprocess.check_call([sys.executable, '-m', 'sphinx', '-W', '--keep-going', '-n', '-q', '-b', 'html',
                           '-d', str(tmp_path / 'trees'), '-c', DOC, ROOT, str(tmp_path / 'html')])
    for path in ('index', 'launch_files', 'nodes/tracker_node'):
        assert (tmp_path / 'html' / 'doc' / (path + '.html')).exists()
