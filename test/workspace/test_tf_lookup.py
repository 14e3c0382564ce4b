import threading

import numpy as np
import pytest
import rospy
import tf2_ros
from tf2_msgs.msg import TFMessage

from ros_3d_bb.conversions.camera_msgs import transform_messages
from ros_3d_bb.nodes.common.tf_lookup import Transforms
from support.masterless import masterless

STAMP = rospy.Time(100)
CAMERAS = 'front', 'rear'


def test_the_transform_is_that_of_the_stamp():
    """The robot drives on while an image waits for its boxes."""
    with masterless() as connections:
        transforms = Transforms(wait_s=0.0)
        for number in range(2):
            sent = link('map', 'base_link', STAMP + rospy.Duration(number))
            sent.transform.translation.x = number
            connections.send('/tf', TFMessage([sent]))
        assert transforms.lookup('map', 'base_link', STAMP + rospy.Duration(0.5))[0, 3] == 0.5


def test_a_late_transform_is_awaited():
    with masterless() as connections:
        transforms, message = Transforms(wait_s=10.0), TFMessage([link('map', 'base_link')])
        threading.Timer(0.1, connections.send, ('/tf', message)).start()
        assert transforms.lookup('map', 'base_link', STAMP)[0, 3] == 0


@pytest.fixture
def transforms():
    """tf knows neither camera."""
    with masterless():
        made = Transforms(wait_s=0.0)
        made.set_transform(link('map', 'base_link'), 'test')
        yield made


def link(parent, child, stamp=STAMP):
    message, = transform_messages(stamp, [(parent, child, np.eye(4))])
    return message


def why_not(transforms, camera):
    with pytest.raises(tf2_ros.TransformException) as error:
        transforms.lookup('map', camera, STAMP)
    return str(error.value)


def test_the_missing_frame_of_each_camera_is_named(transforms):
    for camera in CAMERAS + CAMERAS:
        assert 'tf has no frame %s;' % camera in why_not(transforms, camera)


def test_a_transform_of_the_future_blocks_no_lookup():
    with masterless() as connections:
        transforms, missed = Transforms(wait_s=0.0), []
        for number in range(50):
            stamp = STAMP + rospy.Duration(number * 0.1)
            if number == 20:
                connections.send('/tf', TFMessage([link('map', 'rear', stamp + rospy.Duration(3600))]))
            connections.send('/tf', TFMessage([link('map', camera, stamp) for camera in CAMERAS]))
            for camera in CAMERAS:
                try:
                    transforms.lookup('map', camera, stamp)
                except tf2_ros.TransformException:
                    missed.append((number, camera))
    assert missed == []


def test_a_transform_of_the_future_does_not_stop_the_latest_pose():
    parents = {'odom': 'map', 'base_link': 'odom'}
    with masterless() as connections:
        transforms = Transforms(wait_s=0.0)
        for number in range(30):
            connections.now = stamp = STAMP + rospy.Duration(number * 0.1)
            links = [link(parent, child, stamp) for child, parent in parents.items()]
            links[1].transform.translation.x = number
            if number == 10:
                later = [link(parent, child, stamp + rospy.Duration(3600)) for child, parent in parents.items()]
                connections.send('/tf', TFMessage(later))
            connections.send('/tf', TFMessage(links))
            if number < 10 or number >= 12:
                assert transforms.latest('map', 'base_link', 0.5)[0][0, 3] == number


@pytest.mark.parametrize('in_flight_s', [0.05, 5.9])
def test_a_transform_from_before_a_jump_back_that_arrives_late_is_not_the_latest(in_flight_s):
    """As at each restart of a bag that is shorter than the cache of tf2, which would keep it until the next one."""
    with masterless() as connections:
        transforms, connections.now = Transforms(wait_s=0.0), STAMP + rospy.Duration(5.9)
        connections.send('/tf', TFMessage([link('map', 'base_link', connections.now)]))
        connections.now = STAMP
        connections.send('/tf', TFMessage([link('map', 'base_link', STAMP + rospy.Duration(in_flight_s))]))
        for number in range(30):
            connections.now = stamp = STAMP + rospy.Duration(number * 0.1)
            sent = link('map', 'base_link', stamp)
            sent.transform.translation.x = number
            connections.send('/tf', TFMessage([sent]))
            if number:
                assert transforms.latest('map', 'base_link', 0.5)[0][0, 3] == number


@pytest.mark.parametrize('back_s, is_kept', [(0.02, True), (0.9, True), (3.0, False)])
def test_transforms_are_kept_when_time_goes_back_by_less_than_a_jump(back_s, is_kept):
    """As with each message of a second publisher of /clock, such as a bag that was recorded with all topics."""
    with masterless() as connections:
        transforms = Transforms(wait_s=0.0)
        connections.now = STAMP
        connections.send('/tf', TFMessage([link('map', 'front')]))
        connections.now = STAMP - rospy.Duration(back_s)
        connections.send('/tf', TFMessage([link('map', 'rear')]))
        assert bool(transforms.can_transform_core('map', 'front', STAMP)[0]) is is_kept
