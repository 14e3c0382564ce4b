"""The scenario with two cameras through two detectors, two bbox3d_nodes and one tracker, as a user starts it.

Needs a master: it is about the names of all nodes and topics together, and about images that come when they may.
"""
import os
import subprocess

import pytest
import rosbag
import rospy

from ros_3d_bb.conversions.perception_msgs import stamp_of
from ros_3d_bb.msg import TrackedObjectArray
from ros_3d_bb.tracking.types import OUT_OF_VIEW, VISIBLE
from ros_3d_bb_lab.evaluation.clear_mot import score
from ros_3d_bb_lab.evaluation.demo.scene_report import read_recording
from support.ros import Recorder, launched

SCENARIO = os.path.join(os.path.dirname(__file__), '..', '..', 'config', 'scenarios', 'two_cameras.yaml')
PEOPLE = 4


@pytest.fixture(scope='module')
def run(tmp_path_factory):
    """The bag of a run, at half of the scenario's rate: five images a second from each camera; and what doctor says
    meanwhile, by the camera that it is asked about."""
    rospy.init_node('test_two_cameras')
    path = str(tmp_path_factory.mktemp('scene') / 'run.bag')
    with launched('simulation.launch', 'scenario:=' + os.path.realpath(SCENARIO), 'cameras:=front, left', 'rate:=5.0',
                  'record:=' + path, 'rviz:=false', 'repeat:=false') as process:
        with Recorder('ros_3d_bb/tracks', TrackedObjectArray) as tracks:
            tracks.wait_for(1, 60)
        doctors = {camera: doctor(camera) for camera in ('', 'left')}
        said = {camera: asked.communicate()[0] for camera, asked in doctors.items()}
        assert process.wait(timeout=180) == 0
    return path, said


def doctor(camera):
    return subprocess.Popen(['rosrun', 'ros_3d_bb', 'doctor', '--seconds', '2', '--camera', camera],
                            stdout=subprocess.PIPE, universal_newlines=True)


@pytest.fixture(scope='module')
def bag(run):
    return run[0]


@pytest.fixture(scope='module')
def recording(bag):
    with rosbag.Bag(bag) as opened:
        return read_recording(opened)


def test_everybody_is_one_track_though_they_go_from_one_view_into_the_other(recording):
    result = score(recording.moments)
    assert [person.person for person in result.people] == list(range(1, PEOPLE + 1))
    for person in result.people:
        assert len(person.ids) == 1 and person.rmse_m < 0.25, person
    assert len(set(person.ids[0] for person in result.people)) == PEOPLE
    assert result.false_share < 0.1


def test_there_are_as_many_tracks_as_people(recording):
    """From the second second on, in nearly all images; nobody who is in one of the views is out of view."""
    counts = [len(moment.tracks) for moment in recording.moments if moment.tracks][20:]
    assert len(counts) > 50 and counts.count(PEOPLE) > 0.9 * len(counts) and max(counts) <= PEOPLE + 1
    statuses = [track.status for moment in recording.moments for track in moment.tracks]
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


@pytest.mark.parametrize('asked, camera, other', [('', 'front', 'left'), ('left', 'left', 'front')])
def test_doctor_looks_at_the_topics_of_one_camera(run, asked, camera, other):
    """How fast images come on a busy machine is another matter."""
    said = run[1][asked]
    assert 'cameras: %s; of front, left' % camera in said, said
    for name in ('color/image_raw', 'aligned_depth_to_color/image_raw', 'color/camera_info', 'yolo_bounding_box',
                 'ros_3d_bb/bb_3d'):
        assert '/%s/%s' % (camera, name) in said, said
    assert 'no publishers on' not in said and '/%s/' % other not in said, said
