"""The pipeline on the bag of a measurement session. Needs a master and the clock of the bag."""
import contextlib
import queue
import subprocess
import threading
import time

import numpy as np
import pytest
import rospy
from std_msgs.msg import Int32MultiArray
from visualization_msgs.msg import Marker, MarkerArray

from ros_3d_bb.bags.bag_writer import MOUNT_M, START_NS, session_images, write_bag
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.estimation.box3d_estimator import estimator_named
from ros_3d_bb.msg import BoundingBox3DArray, TrackedObjectArray
from ros_3d_bb.sessions.session_reader import read_depth, read_session
from ros_3d_bb_lab.simulation.ros.scenario_to_bag import scenario_images
from ros_3d_bb_lab.simulation.scenario import scenario_from
from support.ros import Recorder, launched, wait_until


@pytest.fixture(scope='module', autouse=True)
def node():
    rospy.init_node('test_pipeline')


@pytest.fixture(scope='module')
def session(session_folder):
    return read_session(session_folder)


def make_bag(session, folder, rate_hz):
    """Write the session with its boxes to a bag. Returns its path and {stamp: frame}."""
    path = str(folder / ('%g_hz.bag' % rate_hz))
    write_bag(session_images(session, rate_hz, with_boxes=True), path)
    return path, {START_NS + int(number * NS / rate_hz): frame for number, frame in enumerate(session.frames)}


@pytest.fixture(scope='module')
def bag(session, tmp_path_factory):
    return make_bag(session, tmp_path_factory.mktemp('bags'), 30.0)


@contextlib.contextmanager
def delayed(source, target, delay_s):
    """Forwards boxes after a delay by the clock of the machine, as from a slow detector."""
    waiting = queue.Queue()
    publisher = rospy.Publisher(target, Int32MultiArray, queue_size=100)
    subscriber = rospy.Subscriber(source, Int32MultiArray,
                                  lambda message: waiting.put((time.monotonic() + delay_s, message)))

    def forward():
        for due_s, message in iter(waiting.get, None):
            time.sleep(max(0.0, due_s - time.monotonic()))
            publisher.publish(message)

    thread = threading.Thread(target=forward)
    thread.start()
    try:
        wait_until(publisher.get_num_connections, 'a subscriber to the delayed boxes')
        yield
    finally:
        waiting.put(None)
        thread.join()
        subscriber.unregister()
        publisher.unregister()


@pytest.fixture(scope='module')
def bbox3d():
    with launched('bbox3d.launch'):
        yield


@pytest.mark.parametrize('delay_s', [0.0, 0.05, 0.2])
def test_at_30_hz_boxes_are_estimated_in_the_depth_image_of_their_stamp(session, bag, bbox3d, delay_s):
    path, frames = bag
    foreground = estimator_named('foreground')
    with Recorder('ros_3d_bb/bb_3d', BoundingBox3DArray) as output, \
            delayed('recorded_boxes', 'yolo_bounding_box', delay_s):
        subprocess.check_call(['rosbag', 'play', '--quiet', '--clock', '--delay', '2', path,
                               'yolo_bounding_box:=recorded_boxes'])
        wait_until(lambda: len(output.messages) >= len(frames), '%d arrays of boxes' % len(frames), 5)
    assert [message.header.stamp.to_nsec() for message in output.messages] == sorted(frames)
    for message in output.messages:
        frame = frames[message.header.stamp.to_nsec()]
        samples = foreground.sample(read_depth(frame, session), frame.boxes_px[0])
        expected = foreground.estimate(samples, frame.boxes_px[0], session.camera, ())
        center = message.boxes[0].center.position
        np.testing.assert_allclose((center.x, center.y, center.z), expected.center_m, atol=1e-9)


def test_playback_tracks_the_person_in_the_map(session, weights, tmp_path):
    """From the images of the bag alone, with the detector.

    The person jumps every five images; then a new track is started, which is published from the fourth image on.
    """
    path, frames = make_bag(session, tmp_path, 10.0)
    with Recorder('ros_3d_bb/bb_3d', BoundingBox3DArray, False) as boxes, \
            Recorder('ros_3d_bb/tracks', TrackedObjectArray, False) as tracks, \
            Recorder('visualization_marker_array', MarkerArray, False) as markers, \
            launched('playback.launch', 'bag:=' + path, 'weights:=' + weights, 'rviz:=false', 'exit_at_end:=true',
                     'delay:=6') as process:
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
