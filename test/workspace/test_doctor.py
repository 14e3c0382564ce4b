"""The command doctor without a graph: bags, and no master; and what nodes compare by themselves."""
import os
import socket
import subprocess
from unittest import mock

import numpy as np
import pytest
import rosbag
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from sensor_msgs.msg import CameraInfo, Image
from std_msgs.msg import Header

from ros_3d_bb.bags.bag_writer import write_bag
from ros_3d_bb.conversions.image_msgs import fill_image
from ros_3d_bb.diagnosis.bag_observer import observe_bag
from ros_3d_bb.diagnosis.checks import findings
from ros_3d_bb.nodes.bbox3d_node import DepthCameraCheck
from ros_3d_bb.nodes.common.graph_observer import GraphObserver
from ros_3d_bb.nodes.doctor import tracked_cameras
from ros_3d_bb_lab.simulation.ros.scenario_to_bag import scenario_images
from ros_3d_bb_lab.simulation.scenario import scenario_from
from support.masterless import masterless

SCENE = {'duration': 1.0, 'rate': 10.0, 'people': [{'start': [3.0, 0.5], 'moves': [{'to': [3.0, -1.0]}]}]}
DEPTH, INFO = '/camera/aligned_depth_to_color/image_raw', '/camera/color/camera_info'
DEPTH_INFO = '/camera/aligned_depth_to_color/camera_info'


@pytest.fixture(scope='module')
def bag(tmp_path_factory):
    path = str(tmp_path_factory.mktemp('bags') / 'scene.bag')
    write_bag(scenario_images(scenario_from(SCENE), with_boxes=True), path)
    return path


def changed(bag, folder, change):
    """The bag with `change(topic, message)`, a (topic, message) pair or None, in place of each of its messages."""
    path = str(folder / 'changed.bag')
    with rosbag.Bag(bag) as before, rosbag.Bag(path, 'w') as after:
        for topic, message, stamp in before.read_messages():
            pair = change(topic, message)
            if pair is not None:
                after.write(pair[0], pair[1], stamp)
    return path


def wrong_in(path, target_frame='map'):
    seen = observe_bag(path, lambda topic: '/' + topic, target_frame)
    return [finding for finding in findings(seen) if finding.is_wrong]


def doctor(*arguments, **environment):
    """What the command prints, and its exit status."""
    process = subprocess.run(['rosrun', 'ros_3d_bb', 'doctor'] + list(arguments), stdout=subprocess.PIPE,
                             universal_newlines=True, env=dict(os.environ, **environment))
    return process.stdout, process.returncode


def test_in_a_sound_bag_all_is_well(bag):
    said, status = doctor(bag)
    assert status == 0 and said.splitlines()[-1] == 'doctor: all is well', said
    assert 'ok     transforms: camera_color_optical_frame to map' in said
    assert 'ok     boxes and depth: 100 % paired by stamp' in said


def test_a_bag_without_camera_info_says_so_and_exits_with_1(bag, tmp_path):
    said, status = doctor(changed(bag, tmp_path, lambda topic, message: None if topic == INFO else (topic, message)))
    assert status == 1 and 'wrong  camera_info: there is no /camera/color/camera_info in it' in said
    assert 'fix: record it' in said and 'camera_info:=' + DEPTH_INFO in said


def metres(topic, message):
    if topic == DEPTH:
        fill_image(message, np.full((480, 640), 2, np.uint16), '16UC1')
    return topic, message


def renamed(topic, message):
    return topic.replace('/camera/aligned_depth_to_color', '/front/depth'), message


def other_intrinsics(topic, message):
    if topic == DEPTH_INFO:
        message.K = [385.0 if value > 400 else value for value in message.K]
    return topic, message


def empty_info(topic, message):
    return topic, CameraInfo(header=message.header) if topic == INFO else message


def small_depth(topic, message):
    return topic, fill_image(Image(header=message.header), np.full((48, 64), 2000, np.uint16),
                             '16UC1') if topic == DEPTH else message


def without_odom(topic, message):
    if topic == '/tf':
        message.transforms = [link for link in message.transforms if link.child_frame_id != 'odom']
    return topic, message


def later(topic, message):
    if topic == DEPTH:
        message.header.stamp.secs += 3600
    return topic, message


@pytest.mark.parametrize('change, fault, fix', [
    (metres, 'metres in a 16UC1', 'depth_scale'),
    (renamed, 'there is no %s in it' % DEPTH, 'camera_depth:=/front/depth/image_raw'),
    (other_intrinsics, 'the intrinsics fx fy cx cy of depth are 385.0', 'align_depth:=true'),
    (empty_info, 'it is empty', 'camera_calibration'),
    (small_depth, 'the depth image has 64 x 48 pixels, the colour camera 640 x 480', 'align_depth:=true'),
    (without_odom, 'tf knows no frame map; it knows camera_color_optical_frame < base_link < odom',
     'frame_world:=odom'),
    (later, '60.0 minutes from the time of their recording', 'process_bag')])
def test_what_is_wrong_in_a_bag_is_named_with_its_fix(bag, tmp_path, change, fault, fix):
    found = wrong_in(changed(bag, tmp_path, change))
    assert fault in found[0].fault and fix in found[0].fix, found


def test_a_frame_that_the_bag_does_not_have_is_named(bag):
    assert wrong_in(bag, 'odom') == []
    found, = wrong_in(bag, 'world')
    assert 'tf knows no frame world' in found.fault and 'frame_world:=map' in found.fix


def test_names_of_topics_are_given_as_remappings(bag, tmp_path):
    said, status = doctor(changed(bag, tmp_path, renamed), DEPTH[1:] + ':=/front/depth/image_raw')
    assert status == 0, said


def of_front(topic, message):
    own = ('/camera/', '/yolo_bounding_box', '/ros_3d_bb/bb_3d')
    return '/front' + topic.replace('/camera/', '/') if topic.startswith(own) else topic, message


def test_of_a_bag_with_several_cameras_one_is_looked_at(bag, tmp_path):
    path = changed(bag, tmp_path, of_front)
    said, status = doctor(path, '--camera', 'front')
    assert status == 0 and 'ok     depth images: /front/aligned_depth_to_color/image_raw' in said, said
    said, status = doctor(path, '--camera', 'rear')
    assert status == 1 and 'there is no /rear/color/image_raw in it' in said


def test_what_is_no_bag_is_said(tmp_path):
    (tmp_path / 'no.bag').write_text('nothing')
    said, status = doctor(str(tmp_path / 'no.bag'))
    assert status == 1 and 'wrong  bag: ' in said and 'fix: ' in said


@pytest.mark.parametrize('uri, fault', [
    (None, 'no ROS master answers at '), ('http://no.such.host.invalid:11311', 'does not know the name no.such.host'),
    ('localhost', "ROS_MASTER_URI is 'localhost'"), ('http://robot:PORT', "ROS_MASTER_URI is 'http://robot:PORT'")])
def test_without_a_master_that_is_said(uri, fault):
    with socket.socket() as unused:  # bound and not listened to: nobody answers
        unused.bind(('localhost', 0))
        said, status = doctor(ROS_MASTER_URI=uri or 'http://localhost:%d' % unused.getsockname()[1])
    assert status == 1 and 'wrong  master: ' in said and fault in said and 'fix: ' in said
    assert said.splitlines()[-1] == 'doctor: 1 thing is wrong'


def info(frame_id='optical', focal=600.0):
    return CameraInfo(header=Header(frame_id=frame_id), width=640, height=480,
                      K=[focal, 0, 320, 0, focal, 240, 0, 0, 1])


@pytest.fixture
def subscriber():
    """In place of rospy.Subscriber, of the depth camera's camera_info."""
    with mock.patch('rospy.Subscriber') as made, mock.patch('rospy.resolve_name', lambda name: '/' + name):
        yield made


def test_a_node_compares_the_depth_camera_with_that_of_colour_all_the_time(subscriber):
    """It subscribes once, at the start: rospy would wait for a master at a new subscription, and hold up the node."""
    check = DepthCameraCheck(with_frames=True)
    topic, _kind, take = subscriber.call_args[0]
    assert topic == DEPTH_INFO and list(check.faults()) == []
    check.color, check.depth_frame = info(), 'optical'
    assert list(check.faults()) == []
    take(info(focal=385.0))
    (event, sentence), = check.faults()
    assert event == 'alignment' and 'the intrinsics' in sentence and 'align_depth:=true' in sentence
    for one in (info(), CameraInfo()):  # many drivers leave that of depth empty
        take(one)
        assert list(check.faults()) == []
    check.color = info(focal=610.0)  # another one
    take(info())
    assert len(list(check.faults())) == 1
    take(info(focal=610.0))
    assert list(check.faults()) == []
    assert subscriber.call_count == 1 and not subscriber.return_value.unregister.called


def test_a_depth_image_in_another_frame_is_named_where_names_can_be_relied_on(subscriber):
    check = DepthCameraCheck(with_frames=True)
    check.color, check.depth_frame = info(), 'camera_depth_optical_frame'
    (_event, sentence), = check.faults()
    assert 'the depth image is in the frame camera_depth_optical_frame, the colour camera in optical' in sentence
    check = DepthCameraCheck(with_frames=False)
    check.color, check.depth_frame = info(), 'camera_depth_optical_frame'
    assert list(check.faults()) == []


@pytest.fixture
def look():
    """Makes a GraphLook, {topic: type} of what is published, and (node, {input: topic}) of what nodes say."""
    with masterless() as connections, mock.patch('rospy.get_namespace', lambda: '/robot1/'), \
            mock.patch('rospy.resolve_name', lambda name: '/robot1/' + name), mock.patch('time.sleep') as sleep, \
            mock.patch('ros_3d_bb.nodes.common.graph_observer.published_topics') as topics, \
            mock.patch('ros_3d_bb.nodes.common.graph_observer.publishers_of', lambda *_: ()):
        def made(published, said, camera=''):
            topics.return_value = published
            message = DiagnosticArray(status=[DiagnosticStatus(name=node + ': pipeline', values=[
                KeyValue('input ' + name, topic + ' 30.0 Hz') for name, topic in inputs.items()])
                                              for node, inputs in said])
            sleep.side_effect = lambda _s: connections.subscribers['/diagnostics'].callback(message)
            return GraphObserver(camera=camera).observations()
        yield made


def test_of_several_cameras_one_is_looked_at(look):
    """Whichever node says first what its topics are called."""
    said = [('robot1/%s/bbox3d_node' % camera, {DEPTH[1:]: '/robot1/%s/depth' % camera})
            for camera in ('front', 'rear')]
    said.append(('robot1/tracker_node', {'%s/ros_3d_bb/bb_3d' % camera: '/boxes/' + camera
                                         for camera in ('front', 'rear')}))
    for camera in ('front', 'rear'):
        streams = look({}, said, camera).streams
        assert streams['depth'].topic == '/robot1/%s/depth' % camera
        assert streams['boxes3d'].topic == '/boxes/' + camera
        assert streams['color'].topic == '/robot1/%s/color/image_raw' % camera
        assert streams['tracks'].topic == '/robot1/ros_3d_bb/tracks'


def test_a_robot_whose_name_begins_in_the_same_way_is_another(look):
    said = [('robot10/bbox3d_node', {DEPTH[1:]: '/robot10/depth'}), ('robot1/bbox3d_node', {})]
    seen = look({}, said)
    assert set(seen.nodes) == {'robot1/bbox3d_node'} and seen.streams['depth'].topic == '/robot1' + DEPTH


@pytest.mark.parametrize('given, cameras', [('', ['']), ('front, rear', ['front', 'rear']), (['front'], ['front']),
                                            ({'front': 1}, [''])])
def test_the_cameras_are_those_of_the_tracker(given, cameras):
    with mock.patch('rospy.get_param', lambda name, default: given), mock.patch('rospy.resolve_name', str):
        assert tracked_cameras() == cameras
