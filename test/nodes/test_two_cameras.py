"""The scenario with two cameras through two detectors, two bbox3d_nodes and one tracker, as a user starts it.

Needs a master: it is about the names of all nodes and topics together, and about images that come when they may.
"""
import os

import pytest
import rosbag
import rospy

from ros_3d_bb.conversions.perception_msgs import stamp_of
from ros_3d_bb.tracking.types import OUT_OF_VIEW, VISIBLE
from ros_3d_bb_lab.evaluation.clear_mot import score
from ros_3d_bb_lab.evaluation.demo.scene_report import read_recording
from support.ros import launched

SCENARIO = os.path.join(os.path.dirname(__file__), '..', '..', 'config', 'scenarios', 'two_cameras.yaml')
PEOPLE = 4


@pytest.fixture(scope='module')
def bag(tmp_path_factory):
    """The bag of a run, at half of the scenario's rate: five images a second from each camera. It is played at half of
    the speed, so that two detectors keep up on a busy machine."""
    rospy.init_node('test_two_cameras')
    folder = tmp_path_factory.mktemp('scene')
    path = str(folder / 'run.bag')
    (folder / 'simulator.yaml').write_text('speed: 0.5')
    with launched('simulation.launch', 'scenario:=' + os.path.realpath(SCENARIO), 'cameras:=front, left', 'rate:=5.0',
                  'record:=' + path, 'rviz:=false', 'repeat:=false',
                  'sim_params:=%s' % (folder / 'simulator.yaml')) as process:
        assert process.wait(timeout=180) == 0
    return path


def test_each_person_is_one_track_in_the_views_of_both_cameras(bag):
    """After one second, there are as many tracks as people in nearly all images, and no person is out of view."""
    with rosbag.Bag(bag) as opened:
        moments = read_recording(opened).moments
    result = score(moments)
    assert [person.person for person in result.people] == list(range(1, PEOPLE + 1))
    for person in result.people:
        assert len(person.ids) == 1 and person.rmse_m < 0.25, person
    assert len(set(person.ids[0] for person in result.people)) == PEOPLE
    assert result.false_share < 0.1
    counts = [len(moment.tracks) for moment in moments if moment.tracks][20:]
    assert len(counts) > 50 and counts.count(PEOPLE) > 0.9 * len(counts) and max(counts) <= PEOPLE + 1
    statuses = [track.status for moment in moments for track in moment.tracks]
    assert statuses.count(VISIBLE) > 0.9 * len(statuses) and OUT_OF_VIEW not in statuses


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
    assert stamps == sorted(stamps)
