import argparse
import socket
import subprocess
import sys
from unittest import mock

import numpy as np
import pytest
from sensor_msgs.msg import Image

from ros_3d_bb.conversions.camera_msgs import transform_messages
from ros_3d_bb.conversions.image_msgs import fill_image
from ros_3d_bb.conversions.perception_msgs import time_from
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.diagnosis.message_observer import Observation
from ros_3d_bb.diagnosis.observations import Observations, Stream
from ros_3d_bb.diagnosis.roles import ROLES
from ros_3d_bb.diagnosis.tf_arrivals import TfArrivals
from ros_3d_bb.diagnosis.tf_tree import clock_fault_of_tf
from ros_3d_bb.nodes.common.graph_observer import GraphObserver
from ros_3d_bb.nodes.doctor import bag_findings, graph_findings, machine_findings
from ros_3d_bb.pipeline.transform_buffer import TransformBuffer
from support.bags import changed_bag, scene_bag
from support.broken_bags import DEPTH, DEPTH_INFO, INFO, in_the_frame_of_depth
from support.masterless import masterless
from support.ros import header_at

SCENE = {'duration': 1.0, 'rate': 10.0, 'people': [{'start': [3.0, 0.5], 'moves': [{'to': [3.0, -1.0]}]}]}


@pytest.fixture(scope='module')
def bag(tmp_path_factory):
    return scene_bag(tmp_path_factory.mktemp('bags') / 'scene.bag', SCENE, with_boxes=True)


def changed(bag, folder, change):
    """The bag with the (topic, message) of `change(topic, message)` in place of each of its messages."""
    return changed_bag(bag, folder / 'changed.bag', lambda topic, message, time: change(topic, message) + (time,))


def examined(path, camera='', target_frame='', depth='aligned'):
    given = argparse.Namespace(bag=str(path), camera=camera, target_frame=target_frame, depth=depth)
    found, command, _purpose = bag_findings(given)
    return found, command


def faults_in(path, **options):
    return [finding for finding in examined(path, **options)[0] if finding.fault]


def test_a_sound_bag_has_no_faults(bag):
    process = subprocess.run(['rosrun', 'ros_3d_bb', 'doctor', bag], stdout=subprocess.PIPE, universal_newlines=True)
    lines = process.stdout.splitlines()
    assert process.returncode == 0 and 'doctor: no faults found' in lines, process.stdout
    assert any(line.startswith('ok     transforms: camera_color_optical_frame to map') for line in lines)
    assert 'ok     boxes and depth: 100 % paired by stamp' in lines


def without_people(topic, message):
    if topic == '/yolo_bounding_box':
        message.data = []
    return topic, message


def test_empty_arrays_are_named(bag, tmp_path):
    """They are no fault, but tell at which stage people are missing."""
    for path, is_empty in ((bag, False), (changed(bag, tmp_path, without_people), True)):
        facts = {finding.subject: finding.fact for finding in examined(path)[0]}
        assert facts['2D boxes'].endswith('Hz, all empty' if is_empty else 'Hz'), facts


def test_a_file_that_is_no_bag_is_reported(tmp_path):
    (tmp_path / 'no.bag').write_text('no bag')
    found, = faults_in(tmp_path / 'no.bag')
    assert found.subject == 'bag' and found.fix


def renamed(topic, message):
    return topic.replace('/camera/aligned_depth_to_color', '/front/depth'), message


@pytest.mark.parametrize('name', [DEPTH, DEPTH[1:]])
def test_names_of_topics_are_given_as_remappings(bag, tmp_path, monkeypatch, name):
    monkeypatch.setattr(sys, 'argv', ['doctor', name + ':=/front/depth/image_raw'])
    assert faults_in(changed(bag, tmp_path, renamed)) == []


COLOR_RECT, DEPTH_RECT = '/camera/rgb/image_rect_color', '/camera/depth_registered/image_rect'


def rectified(topic, message):
    """As of a Kinect with image_proc: the camera_info is that of the raw colour images, and P that of the rectified."""
    if topic == INFO:
        message.K, message.D = [525, 0, 319.5, 0, 525, 239.5, 0, 0, 1], [0.2, -0.5, 0, 0, 0]
    return {'/camera/color/image_raw': COLOR_RECT, DEPTH: DEPTH_RECT}.get(topic, topic), message


def test_rectified_images_have_the_intrinsics_of_the_rectified_camera(bag, tmp_path, monkeypatch):
    monkeypatch.setattr(sys, 'argv', ['doctor', DEPTH + ':=' + DEPTH_RECT, '/camera/color/image_raw:=' + COLOR_RECT])
    found, command = examined(changed(bag, tmp_path, rectified))
    assert [finding for finding in found if finding.fault] == [] and 'process_bag' in command
    assert any('focal length 615' in finding.fact for finding in found)


def without_map(topic, message):
    if topic == '/tf':
        message.transforms = [link for link in message.transforms if link.header.frame_id != 'map']
    return topic, message


@pytest.mark.parametrize('target_frame', ['', 'odom'])
def test_people_near_a_robot_without_localisation_are_tracked_in_odometry(bag, tmp_path, target_frame):
    """The pose of a camera alone would not move with the robot."""
    _found, command = examined(changed(bag, tmp_path, without_map), target_frame=target_frame)
    assert '--target-frame odom' in command and '--camera' not in command


RAW, RAW_INFO = '/front/depth/image_rect_raw', '/front/depth/camera_info'


def raw_only(topic, message):
    """Depth in the frame of a depth camera, 5 cm beside colour, on topics of its own."""
    topic, message, _time = in_the_frame_of_depth(topic, message, None)
    return {DEPTH: RAW, DEPTH_INFO: RAW_INFO}.get(topic, topic), message


def test_raw_depth_is_not_taken_for_aligned_depth(bag, tmp_path):
    found, command = examined(changed(bag, tmp_path, raw_only))
    fault = [finding for finding in found if finding.fault][0]
    assert fault.subject == 'depth images' and 'camera_depth:=' not in fault.fix and 'depth:=raw' in fault.fix
    assert 'doctor' in command and '--depth raw' in command and 'camera/depth/image_rect_raw:=' + RAW in command


def of_front(topic, message):
    own = ('/camera/', '/yolo_bounding_box', '/ros_3d_bb/bb_3d')
    return '/front' + topic.replace('/camera/', '/') if topic.startswith(own) else topic, message


def test_one_of_several_cameras_in_a_bag_is_checked(bag, tmp_path):
    path = changed(bag, tmp_path, of_front)
    assert faults_in(path, camera='front') == []
    facts = {finding.subject: finding.fact for finding in examined(path, camera='front')[0]}
    assert facts['depth images'].startswith('/front/aligned_depth_to_color/image_raw')
    assert 'there is no /rear/color/image_raw in the bag' in [each.fault for each in faults_in(path, camera='rear')]


@pytest.mark.parametrize('uri, fault', [
    (None, 'no ROS master responds at '), ('http://no.such.host.invalid:11311', 'cannot resolve the name no.such.host'),
    ('localhost', "ROS_MASTER_URI is 'localhost'"), ('http://robot:PORT', "ROS_MASTER_URI is 'http://robot:PORT'")])
def test_a_missing_master_is_reported(monkeypatch, uri, fault):
    with socket.socket() as unused:  # bound, but not listening: connections are rejected
        unused.bind(('localhost', 0))
        monkeypatch.setenv('ROS_MASTER_URI', uri or 'http://localhost:%d' % unused.getsockname()[1])
        found, = machine_findings()
    assert found.subject == 'master' and fault in found.fault and found.fix


@pytest.mark.parametrize('ahead_s, lag_s, in_time, is_fault', [
    (0.0, 0.0, 1.0, False), (0.9, -0.9, 0.9, False), (3.0, -3.0, 0.4, True), (-0.1, 0.1, 1.0, False),
    (-0.8, 0.8, 0.0, True)])
def test_transforms_of_another_clock_are_a_fault(ahead_s, lag_s, in_time, is_fault):
    """Within the transform_tolerance of a localisation, and the time that images wait for their transforms, is none."""
    seen, transforms, arrivals = Observation(ROLES['depth'], DEPTH), TransformBuffer(), TfArrivals()
    for number in range(50):
        now_ns = 1000 * NS + number * NS // 10
        link, = transform_messages(time_from(now_ns + int(ahead_s * NS)), [('map', 'camera', np.eye(4))])
        transforms.set_transform(link, '')
        arrivals.add(link, now_ns)
        seen.take(Image(header=header_at(now_ns, 'camera')), now_ns)
    tf = seen.tf_seen(transforms, 'map', '', arrivals, 0.2)
    assert tf.lags_s['camera'] == pytest.approx(lag_s, abs=1e-6) and tf.in_time == pytest.approx(in_time, abs=0.1)
    assert bool(clock_fault_of_tf(tf, 0.0, 0.2)[0]) == is_fault


@pytest.mark.parametrize('nodes, named', [
    (['robot2/tracker_node', 'robot1/tracker_node'], 'ROS_NAMESPACE=robot1 rosrun ros_3d_bb doctor'),
    (['robot1/tracker_node', 'tracker_node'], ''), (['front/bbox3d_node', 'tracker_node'], ''), ([], '')])
def test_a_pipeline_in_another_namespace_is_reported(monkeypatch, nodes, named):
    """The doctor then finds topics of one of them, and misses others."""
    observer = mock.Mock()
    observer.return_value.observations.return_value = Observations(
        {key: Stream(role, '/' + role.name) for key, role in ROLES.items()}, {}, 5.0,
        nodes={name: (0, 'working') for name in nodes})
    monkeypatch.setattr('ros_3d_bb.nodes.doctor.GraphObserver', observer)
    with masterless():
        found = graph_findings(argparse.Namespace(camera='', target_frame='', seconds=0.0, patience=0.0))
    assert [each.fix for each in found if each.subject == 'namespace'] == ([named] if named else [])


def observed_with(params, *messages):
    """The Observations of a graph with these parameters of nodes, and with these (topic, message)."""
    topics = {topic: message._type for topic, message in messages}
    with masterless(params) as connections, mock.patch('time.sleep'), mock.patch.multiple(
            'ros_3d_bb.nodes.common.graph_observer', published_topics=lambda: topics, publishers_of=mock.Mock()):
        observer = GraphObserver()
        for topic, message in messages:
            connections.subscribers[topic].callback(message)
        return observer.observations()


def test_unit_and_frame_of_depth_may_be_those_of_parameters():
    depth = fill_image(Image(header=header_at(NS, 'wrong')), np.full((48, 64), 2000, np.float32), '32FC1')
    fault = observed_with({}, (DEPTH, depth)).depth.fault
    assert 'millimetres in a 32FC1' in fault
    seen = observed_with({'/bbox3d_node/depth_scale': 0.001, '/bbox3d_node/frame_id': 'camera'}, (DEPTH, depth))
    assert seen.depth.fault == '' and seen.frame_id == 'camera'
