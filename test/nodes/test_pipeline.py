"""The pipeline on the bag of a measurement session. Needs a master and the clock of the bag."""
import numpy as np
import pytest
import rospy
from visualization_msgs.msg import Marker, MarkerArray

from ros_3d_bb.bags.bag_writer import MOUNT_M, START_NS, session_images, write_bag
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.msg import BoundingBox3DArray, TrackedObjectArray
from ros_3d_bb.sessions.session_reader import read_session
from ros_3d_bb_lab.simulation.ros.scenario_to_bag import scenario_images
from ros_3d_bb_lab.simulation.scenario import scenario_from
from support.ros import Recorder, launched, wait_until


@pytest.fixture(scope='module', autouse=True)
def node():
    rospy.init_node('test_pipeline')


@pytest.mark.parametrize('single_process', ['false', 'true'])
def test_playback_tracks_the_person_in_the_map(single_process, session_folder, weights, tmp_path):
    """From the images of a session alone, with the detector.

    The person jumps every five images; then a new track is started, which is published from the fourth image on.
    """
    session, path, rate_hz = read_session(session_folder), str(tmp_path / 'session.bag'), 10.0
    write_bag(session_images(session, rate_hz, with_boxes=True), path)
    frames = {START_NS + int(number * NS / rate_hz): frame for number, frame in enumerate(session.frames)}
    with Recorder('ros_3d_bb/bb_3d', BoundingBox3DArray, False) as boxes, \
            Recorder('ros_3d_bb/tracks', TrackedObjectArray, False) as tracks, \
            Recorder('visualization_marker_array', MarkerArray, False) as markers, \
            launched('playback.launch', 'bag:=' + path, 'weights:=' + weights, 'rviz:=false', 'exit_at_end:=true',
                     'single_process:=' + single_process, 'delay:=10') as process:
        process.wait()
    assert len(boxes.messages) > len(frames) / 2
    assert all(message.header.stamp.to_nsec() in frames for message in boxes.messages + tracks.messages)
    assert all(message.header.frame_id == session.frame_id for message in boxes.messages)
    assert all(message.header.frame_id == 'map' for message in tracks.messages)
    errors_m = []
    for message in tracks.messages:
        right, _down, ahead = frames[message.header.stamp.to_nsec()].estimate_m
        for person in message.objects:
            if person.last_seen == message.header.stamp:
                position = person.pose.pose.position
                errors_m.append(np.hypot(position.x - (ahead + MOUNT_M[0]), position.y + right))
    assert len(errors_m) > len(tracks.messages) * 0.25 and np.percentile(errors_m, 95) < 0.3
    assert all(message.objects[0].id >= 1 for message in tracks.messages if message.objects)
    drawn = set(marker.ns for message in markers.messages for marker in message.markers if marker.action == Marker.ADD)
    assert drawn == {'cylinder', 'id', 'velocity', 'prediction', 'history', 'ellipse'}


def test_each_repetition_of_a_bag_has_new_tracks_with_other_ids(tmp_path):
    """From the first half second on, both people are tracked, and no track of the previous repetition is left."""
    path = str(tmp_path / 'people.bag')
    people = [{'start': [4.0, 0.8], 'facing': 3.1}, {'start': [5.0, -0.9], 'facing': 1.6}]
    count = write_bag(scenario_images(scenario_from({'duration': 3.0, 'rate': 10.0, 'people': people}), True), path)
    with Recorder('ros_3d_bb/tracks', TrackedObjectArray, False) as tracks, \
            launched('playback.launch', 'bag:=' + path, 'detector:=none', 'rviz:=false', 'loop:=true', 'delay:=4'):
        wait_until(lambda: len(rounds_of(tracks.messages)) == 3, 'two rounds', 60)
    last_id = 0
    for messages in rounds_of(tracks.messages)[:2]:
        assert len(messages) > count / 2
        for message in messages[6:]:
            assert len(message.objects) == 2
        smaller_id, larger_id = sorted(set(track.id for message in messages for track in message.objects))
        assert smaller_id > last_id
        last_id = larger_id


def rounds_of(messages):
    """Messages by repetition: stamps decrease at the start of each one."""
    starts = [number for number in range(1, len(messages))
              if messages[number].header.stamp < messages[number - 1].header.stamp]
    return [messages[start:end] for start, end in zip([0] + starts, starts + [len(messages)])]
