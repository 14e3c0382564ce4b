"""The scenario with two cameras through two detectors, two bbox3d_nodes and one tracker, as a user starts it.

Needs a master: it is about the names of all nodes and topics together. test_cameras.py compares tracks with the truth.
"""
import os

import pytest
import rosbag
import rospy
import yaml

from ros_3d_bb.conversions.perception_msgs import stamp_of
from support.ros import launched

SCENARIO = os.path.join(os.path.dirname(__file__), '..', '..', 'config', 'scenarios', 'two_cameras.yaml')


@pytest.fixture(scope='module')
def bag(tmp_path_factory):
    """The bag of the first seconds of the scenario, with five images a second from each camera."""
    rospy.init_node('test_two_cameras')
    folder = tmp_path_factory.mktemp('scene')
    path = str(folder / 'run.bag')
    with open(SCENARIO) as stream:
        scene = yaml.safe_load(stream)
    room = os.path.join(os.path.dirname(os.path.realpath(SCENARIO)), scene['room'])
    (folder / 'scene.yaml').write_text(yaml.safe_dump(dict(scene, room=room, duration=4.0)))
    with launched('simulation.launch', 'scenario:=%s' % (folder / 'scene.yaml'), 'cameras:=front, left', 'rate:=5.0',
                  'record:=' + path, 'rviz:=false', 'repeat:=false') as process:
        assert process.wait(timeout=180) == 0
    return path


def test_each_camera_has_its_topics_and_the_tracks_have_one(bag):
    with rosbag.Bag(bag) as opened:
        topics = opened.get_type_and_topic_info().topics
        stamps = [stamp_of(message) for _topic, message, _time in opened.read_messages('/ros_3d_bb/tracks')]
    for camera in ('front', 'left'):
        assert {'/%s/%s' % (camera, name) for name in (
            'color/image_raw', 'aligned_depth_to_color/image_raw', 'color/camera_info', 'yolo_bounding_box',
            'ros_3d_bb/bb_3d')} <= set(topics)
    assert {'/ros_3d_bb/tracks', '/visualization_marker_array'} <= set(topics)
    assert not [topic for topic in topics if topic.endswith(('yolo_result_out', 'ros_3d_bb/color'))]
    assert len(stamps) > 10 and stamps == sorted(stamps)
