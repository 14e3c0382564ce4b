"""What nodes and doctor say of a graph in which one thing is wrong, and that it is forgotten when that ends. Needs a
master because the faults are those of topics, transforms and clocks.
"""
import argparse
import contextlib
import subprocess
import threading
import time

import numpy as np
import pytest
import rosgraph
import rospy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import TransformStamped
from rosgraph_msgs.msg import Log
from sensor_msgs.msg import CameraInfo, Image
from std_msgs.msg import Int32MultiArray
from tf2_msgs.msg import TFMessage

from ros_3d_bb.conversions.image_msgs import fill_image
from ros_3d_bb.conversions.perception_msgs import boxes2d_from_msg, boxes2d_to_msg
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.nodes.doctor import graph_findings
from ros_3d_bb_lab.evaluation.latency.benchmark import end, free_port
from support.ros import Recorder, camera_info, depth_message, header_at, wait_until

COLOR, DEPTH = 'camera/color/image_raw', 'camera/aligned_depth_to_color/image_raw'
INFO, DEPTH_INFO, BOXES = 'camera/color/camera_info', 'camera/aligned_depth_to_color/camera_info', 'yolo_bounding_box'
KINDS = {'/tf': TFMessage, INFO: CameraInfo, DEPTH_INFO: CameraInfo, DEPTH: Image, COLOR: Image, BOXES: Int32MultiArray}
PERIOD_S = 0.1


class Rig(object):
    """A camera and a detector at work; `change(topic, message)` returns what is sent instead, or None."""

    def __init__(self):
        self.change = unchanged
        self.pubs = {topic: rospy.Publisher(topic, kind, queue_size=10) for topic, kind in KINDS.items()}
        thread = threading.Thread(target=self._run)
        thread.daemon = True
        thread.start()

    def _run(self):
        while not rospy.is_shutdown():
            stamp_ns = int(time.time() * NS)
            for topic in KINDS:
                message = self.change(topic, made(topic, stamp_ns))
                if message is not None and topic in self.pubs:
                    self.pubs[topic].publish(message)
            time.sleep(PERIOD_S)


def unchanged(_topic, message):
    return message


def made(topic, stamp_ns):
    if topic == '/tf':
        transform = TransformStamped(header=header_at(stamp_ns, 'map'), child_frame_id='camera_color_optical_frame')
        turn = transform.transform.rotation
        turn.x, turn.y, turn.z, turn.w = -0.5, 0.5, -0.5, 0.5
        return TFMessage([transform])
    if topic in (INFO, DEPTH_INFO):
        return camera_info(stamp_ns)
    if topic == DEPTH:
        return depth_message(stamp_ns, 2000)
    if topic == COLOR:
        return fill_image(Image(header=header_at(stamp_ns)), np.zeros((48, 64, 3), np.uint8), 'rgb8')
    return boxes2d_to_msg(np.array([[20, 10, 44, 38]]), header_at(stamp_ns))


def without(*topics):
    """Nothing comes on some topics."""
    return lambda topic, message: None if topic in topics else message


def replaced(topic, make):
    """A message of one topic is made anew."""
    return lambda other, message: make(message) if other == topic else message


def metres(message):
    return fill_image(Image(header=message.header), np.full((48, 64), 2, np.uint16), '16UC1')


def smaller(message):
    return fill_image(Image(header=message.header), np.full((24, 32), 2000, np.uint16), '16UC1')


def empty(message):
    return CameraInfo(header=message.header)


def wider(message):
    return camera_info(message.header.stamp.to_nsec(), focal=45.0)


def long_ago(_topic, message):
    """As of a bag of two years ago that is played without its clock."""
    if isinstance(message, Int32MultiArray):
        boxes = boxes2d_from_msg(message)
        return boxes2d_to_msg(boxes.boxes, header_at(boxes.stamp_ns - 63000000 * NS))
    for part in getattr(message, 'transforms', [message]):
        part.header.stamp = part.header.stamp - rospy.Duration(63000000)
    return message


def old_boxes(message):
    stamp_ns = int((time.time() - 3) * NS)
    return boxes2d_to_msg(np.array([[20, 10, 44, 38]]), header_at(stamp_ns))


# what is wrong; who says what in its log; what doctor says, and its fix
REFUSED = {
    'no tf': (without('/tf'), 'tracker_node',
              'the transform from camera_color_optical_frame to map ends', 'tf knows no frames at all',
              'robot_state_publisher'),
    'depth of another size': (replaced(DEPTH, smaller), 'bbox3d_node', 'depth must be aligned to colour',
                              'the depth image has 32 x 24 pixels, the colour camera 64 x 48', 'realsense.launch'),
    'metres in a 16UC1': (replaced(DEPTH, metres), 'bbox3d_node', 'metres in a 16UC1', 'metres in a 16UC1',
                          'depth_scale'),
    'empty camera_info': (replaced(INFO, empty), 'bbox3d_node', 'camera_info rejected: it is empty', 'it is empty',
                          'camera_calibration'),
    'boxes older than the cache': (replaced(BOXES, old_boxes), 'bbox3d_node', 's too old; the detector is slower',
                                   'the 2D boxes come 3.', 'cache_length')}
LASTING = {
    'depth of another camera': (replaced(DEPTH_INFO, wider), 'bbox3d_node', 'depth is not aligned to colour: the '
                                'intrinsics', 'intrinsics fx fy cx cy of depth are 45.0', 'align_depth:=true'),
    'stamps of two years ago': (long_ago, 'bbox3d_node', '729.2 days before ROS time', '729.2 days before ROS time',
                                'use_sim_time'),
    'no boxes': (without(BOXES), 'bbox3d_node', 'nothing has come on /yolo_bounding_box',
                 'images come and no 2D boxes', 'enable')}


@pytest.fixture(scope='module', autouse=True)
def self_checking(tmp_path_factory):
    """What a pipeline says that checks itself, without a detector and with depth on a topic that nobody publishes.

    It waits half a minute for what is missing: on a master of its own, while the other tests run.
    """
    said = tmp_path_factory.mktemp('self_checking') / 'said.txt'
    with open(str(said), 'w') as stream:
        process = subprocess.Popen(['roslaunch', '-p', str(free_port()), 'ros_3d_bb', 'pipeline.launch',
                                    'detector:=none', 'check:=true', 'camera_depth:=/other/depth'], stdout=stream)
    yield said
    end(process)


@pytest.fixture(scope='module')
def rig():
    rospy.init_node('test_diagnosis')
    return Rig()


@pytest.fixture(scope='module')
def log(rig):
    with Recorder('/rosout', Log) as recorder:
        yield recorder


class States(object):
    """What nodes say of themselves; one connection for all tests."""

    def __init__(self):
        self._newest = {}
        rospy.Subscriber('/diagnostics', DiagnosticArray, self._on_diagnostics)

    def _on_diagnostics(self, message):
        for status in message.status:
            self._newest[status.name.split(':')[0]] = status

    def of(self, node):
        """(level, sentence, {name: text})."""
        status = self._newest.get(node, DiagnosticStatus())
        return status.level, status.message, {entry.key: entry.value for entry in status.values}


@pytest.fixture(scope='module')
def states(rig):
    return States()


@pytest.fixture
def healthy(rig, states):
    """The graph, in which nothing is wrong before and after."""
    rig.change = unchanged
    wait_until_well(states)
    yield rig
    rig.change = unchanged
    wait_until_well(states)


def wait_until_well(states):
    wait_until(lambda: all(states.of(node)[:2] == (0, 'working') for node in ('bbox3d_node', 'tracker_node')),
               'both nodes working')


def wait_for_line(log, node, words):
    wait_until(lambda: any(message.name == '/' + node and words in message.msg for message in log.messages),
               'the line %r of %s' % (words, node))


def diagnosed():
    """What doctor says is wrong, as it prints it."""
    found = graph_findings(argparse.Namespace(seconds=1.0, patience=0.0, target_frame='', camera=''))
    return '\n'.join(line for finding in found if finding.is_wrong for line in finding.lines)


def test_of_a_healthy_graph_all_is_well(healthy):
    process = subprocess.run(['rosrun', 'ros_3d_bb', 'doctor', '--seconds', '1', '--patience', '60'],
                             stdout=subprocess.PIPE, universal_newlines=True)
    lines = process.stdout.splitlines()
    assert process.returncode == 0 and lines[-1] == 'doctor: all is well', process.stdout
    assert all(line.startswith('ok ') for line in lines[:-1]) and len(lines) > 15


def test_nodes_show_rates_latency_and_the_age_of_transforms(healthy, states):
    def shows(node):
        values = states.of(node)[2]
        return (0 < float(values['rate'].split()[0]) < 30 and values['latency'].endswith('from stamp to result')
                and values['input ' + DEPTH].startswith('/' + DEPTH))
    for node in ('bbox3d_node', 'tracker_node'):
        wait_until(lambda: shows(node), 'what %s shows in a second with answers' % node)
    wait_until(lambda: abs(float(states.of('tracker_node')[2]['tf age'].split()[0])) < 5, 'the age of a transform')


def check_named(fault, rig, log, states):
    """That a fault is named by a node, in its log and as its state, and by doctor, with its fix."""
    log.emptied()
    rig.change, node, words, found, fix = fault
    said = diagnosed()  # while the node waits until it may complain
    wait_for_line(log, node, words)
    wait_until(lambda: states.of(node)[0] == 1 and words in states.of(node)[1], 'the state of ' + node)
    assert found in said and fix in said, said


@pytest.mark.parametrize('name', sorted(REFUSED))
def test_why_messages_are_refused_is_named_by_a_node_and_by_doctor(rig, log, states, name):
    """One after the other: the newest warning is a node's state for 5 s, if no other one comes."""
    check_named(REFUSED[name], rig, log, states)


@pytest.mark.parametrize('name', sorted(LASTING))
def test_what_is_wrong_is_named_by_a_node_and_by_doctor_and_forgotten_at_its_end(healthy, log, states, name):
    """The refusals, too: nodes are healthy before the first of these."""
    check_named(LASTING[name], healthy, log, states)


@contextlib.contextmanager
def unpublished(rig, *topics):
    """Nobody publishes some topics within the block."""
    for topic in topics:
        rig.pubs.pop(topic).unregister()
    try:
        yield
    finally:
        rig.pubs.update((topic, rospy.Publisher(topic, KINDS[topic], queue_size=10)) for topic in topics)


def test_another_name_of_a_topic_is_suggested_and_a_publisher_that_cannot_be_reached_is_named(healthy, log):
    """Depth comes on the topic of another camera. A node on a machine whose name nobody here knows says that it
    publishes camera_info. There are no 2D boxes meanwhile, which would be refused.
    """
    ghost, address = rosgraph.Master('/ghost'), 'http://no.such.host.invalid:40000'
    log.emptied()
    other = rospy.Publisher('front/aligned_depth_to_color/image_raw', Image, queue_size=1)
    with unpublished(healthy, BOXES, DEPTH, INFO), contextlib.ExitStack() as at_the_end:
        at_the_end.callback(other.unregister)
        at_the_end.callback(ghost.unregisterPublisher, '/' + INFO, address)
        ghost.registerPublisher('/' + INFO, 'sensor_msgs/CameraInfo', address)
        said = diagnosed()
        assert 'nobody publishes /' + DEPTH in said
        assert 'camera_depth:=/front/aligned_depth_to_color/image_raw' in said
        assert '/ghost publishes it, but it calls its machine no.such.host.invalid' in said and 'ROS_IP' in said
        wait_for_line(log, 'bbox3d_node', 'nobody publishes /%s; start the camera' % DEPTH)
        wait_for_line(log, 'bbox3d_node', '/ghost publishes it, but it calls its machine no.such.host.invalid')


def test_time_that_stands_still_is_named(states):
    """A node that starts with /use_sim_time and without /clock, and doctor, in processes of their own."""
    rospy.set_param('/use_sim_time', True)
    process = subprocess.Popen(['rosrun', 'ros_3d_bb', 'bbox3d_node', '__name:=without_time',
                                'ros_3d_bb/bb_3d:=without_time/bb_3d'])  # no second result for each image
    try:
        doctor = subprocess.run(['rosrun', 'ros_3d_bb', 'doctor', '--seconds', '1'], stdout=subprocess.PIPE,
                                universal_newlines=True)
        assert doctor.returncode == 1 and 'nothing comes on /clock' in doctor.stdout
        assert 'fix: play the bag with rosbag play --clock' in doctor.stdout
        wait_until(lambda: 'nothing comes on /clock' in states.of('without_time')[1], 'the reason')
    finally:
        process.kill()
        process.wait()
        rospy.delete_param('/use_sim_time')


def test_the_pipeline_checks_itself_where_it_is_asked_to(self_checking):
    wait_until(lambda: 'doctor: ' in self_checking.read_text(), 'what doctor says', 60)
    said = self_checking.read_text()
    assert 'nobody publishes /other/depth' in said and 'wrong' in said
