"""Descriptions of the camera on a Jackal, and the launch file for Gazebo without Gazebo. test/gazebo runs it."""
import os
import xml.etree.ElementTree as ElementTree

import numpy as np
import pytest
import xacro

from ros_3d_bb.camera.camera_model import transform_from, transform_points
from ros_3d_bb.conversions.camera_msgs import COLOR_TOPIC, DEPTH_TOPIC, INFO_TOPICS
from support.launching import JACKAL_TO_BE_EXTENDED, dumped, given_to_stand_ins, stand_in_gazebo, write


def parent_from_child(joint):
    """The 4x4 transform of a URDF joint; rpy are rotations about the fixed axes x, y, z in this order."""
    origin = joint.find('origin')
    xyz, rpy = ([float(value) for value in (origin.get(key, '0 0 0') if origin is not None else '0 0 0').split()]
                for key in ('xyz', 'rpy'))
    roll, pitch, yaw = (transform_from((0, 0, 0), np.append(np.sin(angle / 2) * axis, np.cos(angle / 2)))
                        for angle, axis in zip(rpy, np.eye(3)))
    return transform_from(xyz, (0, 0, 0, 1)).dot(yaw).dot(pitch).dot(roll)


def base_from(frame, description):
    """The 4x4 transform from a link to base_link. KeyError where no joint holds it."""
    joints = {joint.find('child').get('link'): joint for joint in description.findall('joint')}
    transform = np.eye(4)
    while frame != 'base_link':
        transform = parent_from_child(joints[frame]).dot(transform)
        frame = joints[frame].find('parent').get('link')
    return transform


ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
CAMERA_POSITION = (0.17, 0.0, 0.20)  # in base_link, thesis 3.5.1


@pytest.fixture
def robot(tmp_path, monkeypatch):
    """The robot's description with a camera of urdf/, as a function of xacro arguments."""
    write(tmp_path / 'robot.urdf.xacro', JACKAL_TO_BE_EXTENDED)

    def described(camera='d435i', **arguments):
        monkeypatch.setenv('JACKAL_URDF_EXTRAS', os.path.join(ROOT, 'urdf', camera + '.urdf.xacro'))
        return ElementTree.fromstring(
            xacro.process_file(str(tmp_path / 'robot.urdf.xacro'), mappings=arguments).toxml())
    return described


def test_only_camera_link_is_added_because_the_driver_publishes_the_others(robot):
    description = robot('jackal_d435i')
    assert [link.get('name') for link in description.findall('link')] == ['base_link', 'camera_link']
    np.testing.assert_allclose(base_from('camera_link', description)[:3, 3], CAMERA_POSITION)


@pytest.mark.parametrize('stream', ['color', 'depth'])
def test_optical_frames_are_at_the_position_in_the_thesis_and_face_forward(robot, stream):
    base_from_optical = base_from('camera_%s_optical_frame' % stream, robot())
    right, down, ahead = (0, -1, 0), (0, 0, -1), (1, 0, 0)
    expected = np.array([CAMERA_POSITION] * 4) + [(0, 0, 0), right, down, ahead]
    np.testing.assert_allclose(transform_points(base_from_optical, np.vstack((np.zeros(3), np.eye(3)))), expected,
                               atol=1e-12)


def test_gazebo_publishes_the_topics_of_the_pipeline(robot):
    description = robot()
    plugin = description.find('.//plugin')
    topics = {key: plugin.findtext('cameraName') + '/' + plugin.findtext(element)
              for key, element in (('camera_image', 'imageTopicName'), ('camera_depth', 'depthImageTopicName'),
                                   ('camera_info', 'cameraInfoTopicName'))}
    assert topics == {'camera_image': COLOR_TOPIC, 'camera_depth': DEPTH_TOPIC, 'camera_info': INFO_TOPICS[0]}
    sensor_frame = description.find('.//sensor/..').get('reference')
    np.testing.assert_allclose(base_from(sensor_frame, description)[:3, 3],
                               base_from(plugin.findtext('frameName'), description)[:3, 3])


def test_the_launch_file_starts_gazebo_the_robot_and_the_pipeline(tmp_path):
    stand_in_gazebo(tmp_path)
    parameters = dumped('gazebo.launch', tmp_path, 'weights:=/some/yolov5n.pt', 'gui:=false', 'y:=-1.5', 'yaw:=0.3')
    given = given_to_stand_ins(parameters)
    assert os.path.samefile(given.pop('world_name'), os.path.join(ROOT, 'worlds', 'people.world'))
    assert given == {'gui': 'false', 'x': '0.0', 'y': '-1.5', 'yaw': '0.3', 'z': '0.1', 'joystick': 'false',
                     'paused': 'false'}
    assert 'camera_color_optical_frame' in parameters['/robot_description']
    assert parameters['/detector_node/weights'] == '/some/yolov5n.pt'
    assert parameters['/tracker_node/target_frame'] == 'odom'
