"""Reports of the nodes and of doctor about a graph with one fault, and their end when the fault ends. Needs a master
because the faults are those of topics, transforms and clocks.
"""
import argparse
import subprocess
import sys
import threading
import time

import pytest
import rosgraph
import rospy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rosgraph_msgs.msg import Log
from sensor_msgs.msg import Image
from std_msgs.msg import Int32MultiArray

from ros_3d_bb.conversions.camera_msgs import DEPTH_TOPIC as DEPTH, INFO_TOPICS, TYPES
from ros_3d_bb.conversions.perception_msgs import BOXES_TOPIC as BOXES
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.nodes.doctor import graph_findings
from ros_3d_bb_lab.evaluation.launching import free_port, running_roslaunch
from support.inputs import good_messages, transforms
from support.ros import Recorder, wait_until

INFO, KINDS = INFO_TOPICS[0], dict(TYPES, **{BOXES: Int32MultiArray})
PERIOD_S = 0.1
OTHER_VERSION = """
import rospy
from std_msgs.msg import Int32MultiArray
Int32MultiArray._md5sum = '0' * 32
rospy.init_node('other_version')
rospy.Publisher('%s', Int32MultiArray, queue_size=1)
rospy.spin()
"""


class Rig(object):
    """A camera and a detector, and the log and the status of the nodes.

    `change` maps the stamp to the messages that are sent instead, {topic: message or None}.
    """

    def __init__(self):
        self.change, self._statuses = unchanged, {}
        self.pubs = {topic: rospy.Publisher(topic, kind, queue_size=10) for topic, kind in KINDS.items()}
        self.log = Recorder('/rosout', Log)
        rospy.Subscriber('/diagnostics', DiagnosticArray, self._on_diagnostics)
        threading.Thread(target=self._run, daemon=True).start()

    def status_of(self, node):
        """(level, sentence, {name: text})."""
        status = self._statuses.get(node, DiagnosticStatus())
        return status.level, status.message, {entry.key: entry.value for entry in status.values}

    def wait_until_healthy(self):
        self.change = unchanged
        wait_until(lambda: all(self.status_of(node)[:2] == (0, 'working') for node in ('bbox3d_node', 'tracker_node')),
                   'both nodes working')

    def wait_for_line(self, node, words):
        wait_until(lambda: any(message.name == '/' + node and words in message.msg for message in self.log.messages),
                   'the line %r of %s' % (words, node))

    def _on_diagnostics(self, message):
        self._statuses.update((status.name.split(':')[0], status) for status in message.status)

    def _run(self):
        while not rospy.is_shutdown():
            stamp_ns = int(time.time() * NS)
            for topic, message in dict(messages_at(stamp_ns), **self.change(stamp_ns)).items():
                if message is not None and topic in self.pubs:
                    self.pubs[topic].publish(message)
            time.sleep(PERIOD_S)


def unchanged(_stamp_ns):
    return {}


def messages_at(stamp_ns):
    """{topic: message} of an image and its boxes, in the order in which they are sent."""
    return dict(good_messages(stamp_ns), tf=transforms(stamp_ns))


# The fault (see Rig.change); the node that reports it and words of its report; words of doctor, and of its fix.
FAULTS = {
    'no tf': (lambda _stamp_ns: {'tf': None}, 'tracker_node',
              'the transform from camera to base_link ends', 'tf has no frames', 'robot_state_publisher'),
    'no boxes': (lambda _stamp_ns: {BOXES: None}, 'bbox3d_node', 'no messages on /yolo_bounding_box',
                 'no messages on /yolo_bounding_box', 'enable')}


@pytest.fixture(scope='module', autouse=True)
def check_output(tmp_path_factory):
    """Output of a pipeline with check:=true, without a detector and without publishers on the topic of depth.

    It repeats the checks for half a minute: on a master of its own, while the other tests run.
    """
    path = tmp_path_factory.mktemp('check') / 'output.txt'
    with open(str(path), 'w') as stream, running_roslaunch(
            ['ros_3d_bb', 'pipeline.launch', 'detector:=none', 'check:=true', 'camera_depth:=/other/depth'],
            free_port(), stream):
        yield path


@pytest.fixture(scope='module')
def rig():
    return Rig()


@pytest.fixture
def healthy(rig):
    rig.wait_until_healthy()
    return rig


def diagnosed():
    found = graph_findings(argparse.Namespace(seconds=1.0, patience=0.0, target_frame='', camera=''))
    return '\n'.join(line for finding in found if finding.fault for line in finding.lines)


def test_a_healthy_graph_has_no_faults(healthy):
    process = subprocess.run(['rosrun', 'ros_3d_bb', 'doctor', '--seconds', '1', '--patience', '60'],
                             stdout=subprocess.PIPE, universal_newlines=True)
    lines = process.stdout.splitlines()
    assert process.returncode == 0 and lines[-1] == 'doctor: no faults found', process.stdout
    assert all(line.startswith('ok ') for line in lines[:-1]) and len(lines) > 15


@pytest.mark.parametrize('name', FAULTS)
def test_a_fault_is_reported_until_it_ends(rig, name):
    """By a node, in its log and as its status, and by doctor, with its fix."""
    rig.log.emptied()
    rig.change, node, words, found, fix = FAULTS[name]
    output = diagnosed()  # meanwhile, the node waits before it warns
    rig.wait_for_line(node, words)
    wait_until(lambda: rig.status_of(node)[0] == 1 and words in rig.status_of(node)[1], 'the status of ' + node)
    assert found in output and fix in output, output
    rig.wait_until_healthy()


def test_renamed_topics_and_unreachable_publishers_are_reported(healthy):
    """As the last test of the graph: depth is on the topic of another camera, camera_info is published by a node on a
    machine with an unknown name, and 2D boxes by one with another version of the message.
    """
    ghost, address = rosgraph.Master('/ghost'), 'http://no.such.host.invalid:40000'
    healthy.log.emptied()
    rospy.Publisher('front/aligned_depth_to_color/image_raw', Image, queue_size=1)
    for topic in (BOXES, DEPTH, INFO):
        healthy.pubs.pop(topic).unregister()
    detector = subprocess.Popen([sys.executable, '-c', OTHER_VERSION % BOXES])
    ghost.registerPublisher('/' + INFO, 'sensor_msgs/CameraInfo', address)
    try:
        wait_until(lambda: '/' + BOXES in dict(ghost.getPublishedTopics('/')), 'the publisher of 2D boxes')
        output = diagnosed()
        assert 'no publishers on /' + DEPTH in output
        assert 'camera_depth:=/front/aligned_depth_to_color/image_raw' in output
        unreachable = '/ghost publishes it, but this machine cannot resolve its host name no.such.host.invalid'
        assert unreachable in output and 'ROS_IP' in output
        other = 'it has another version of std_msgs/Int32MultiArray (md5sum 000'
        assert other in output and 'build the same version of std_msgs on all machines' in output
        healthy.wait_for_line('bbox3d_node', 'no publishers on /%s; start the camera' % DEPTH)
        healthy.wait_for_line('bbox3d_node', other)
        healthy.wait_for_line('bbox3d_node', unreachable)
    finally:
        ghost.unregisterPublisher('/' + INFO, address)
        detector.kill()


def test_the_pipeline_checks_itself_with_check_true(check_output):
    wait_until(lambda: 'doctor: ' in check_output.read_text(), 'the output of doctor', 60)
    assert 'no publishers on /other/depth' in check_output.read_text()
