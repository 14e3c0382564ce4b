"""Transforms for several cameras, without a master."""
import threading

import pytest
import rospy
import tf2_ros
from geometry_msgs.msg import TransformStamped
from std_msgs.msg import Header
from tf2_msgs.msg import TFMessage

from ros_3d_bb.nodes.common import tf_lookup as module
from ros_3d_bb.nodes.common.tf_lookup import Transforms
from support.masterless import masterless

STAMP = rospy.Time(100)
CAMERAS = 'front', 'rear'


@pytest.fixture
def transforms():
    """tf knows neither camera."""
    with masterless() as connections:
        made = Transforms(wait_s=0.0)
        connections.buffers[0].set_transform(link('map', 'base_link'), 'test')
        yield made


def link(parent, child, stamp=STAMP):
    made = TransformStamped(header=Header(frame_id=parent, stamp=stamp), child_frame_id=child)
    made.transform.rotation.w = 1.0
    return made


def why_not(transforms, camera):
    with pytest.raises(tf2_ros.TransformException) as error:
        transforms.lookup('map', camera, STAMP)
    return str(error.value)


def test_the_missing_frame_of_each_camera_is_named(transforms):
    for camera in CAMERAS + CAMERAS:
        assert 'tf has no frame %s;' % camera in why_not(transforms, camera)


def test_the_age_is_that_of_each_camera(transforms):
    assert transforms.age() == 'not requested yet'
    why_not(transforms, 'rear')
    assert transforms.age() == 'none from rear to map'
    why_not(transforms, 'front')
    assert transforms.age() == 'none from front to map, none from rear to map'


def test_lookups_of_other_cameras_succeed_while_a_fault_is_explained(transforms, monkeypatch):
    """The tree is read while the other thread holds it up."""
    looked = []

    def slow(_links, target, source, stamp_s):
        thread = threading.Thread(target=lambda: looked.append(transforms.lookup('map', 'base_link', STAMP)))
        thread.daemon = True
        thread.start()
        thread.join(10)
        return 'gone', ''
    monkeypatch.setattr(module, 'why_missing', slow)
    assert why_not(transforms, 'front') == 'gone' and len(looked) == 1


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
