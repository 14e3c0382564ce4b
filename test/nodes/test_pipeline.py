"""The whole pipeline on a bag of a measurement session, as a user starts it. Needs a master and the bag's clock."""
import collections
import subprocess
import threading
import time

import numpy as np
import pytest
import rospy
from std_msgs.msg import Int32MultiArray
from visualization_msgs.msg import Marker, MarkerArray

from ros_3d_bb.bags.bag_writer import MOUNT_M, START_NS, SessionBagOptions, session_images, write_bag
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
    """A bag of the session with its recorded boxes; returns its path and {stamp: frame}."""
    path = str(folder / ('%g_hz.bag' % rate_hz))
    write_bag(session_images(session, SessionBagOptions(rate_hz=rate_hz, with_boxes=True)), path)
    return path, {START_NS + int(number * NS / rate_hz): frame for number, frame in enumerate(session.frames)}


@pytest.fixture(scope='module')
def bag(session, tmp_path_factory):
    return make_bag(session, tmp_path_factory.mktemp('bags'), 30.0)


class Delayed(object):
    """Sends on the boxes of a topic after a delay by the machine's clock, as a detector of that speed would.

    Use as a context manager.
    """

    def __init__(self, source, target, delay_s):
        self._queue, self._delay_s, self._running = collections.deque(), delay_s, True
        self._publisher = rospy.Publisher(target, Int32MultiArray, queue_size=100)
        self._subscriber = rospy.Subscriber(source, Int32MultiArray,
                                            lambda message: self._queue.append((time.monotonic(), message)))
        self._thread = threading.Thread(target=self._run)
        self._thread.daemon = True
        self._thread.start()

    def __enter__(self):
        wait_until(lambda: self._publisher.get_num_connections(), 'a subscriber to the delayed boxes')
        return self

    def _run(self):
        while self._running:
            while self._queue and time.monotonic() - self._queue[0][0] >= self._delay_s:
                self._publisher.publish(self._queue.popleft()[1])
            time.sleep(0.001)

    def __exit__(self, *_):
        self._running = False
        self._thread.join()
        self._subscriber.unregister()
        self._publisher.unregister()


@pytest.fixture(scope='module')
def bbox3d():
    with launched('bbox3d.launch'):
        yield


@pytest.mark.parametrize('delay_s', [0.0, 0.05, 0.2])
def test_at_30_hz_every_array_gets_its_own_depth_image(session, bag, bbox3d, delay_s):
    """All frames are answered, each with its own stamp and with the numbers that its own depth image gives."""
    path, frames = bag
    foreground = estimator_named('foreground')
    with Recorder('ros_3d_bb/bb_3d', BoundingBox3DArray) as output, \
            Delayed('recorded_boxes', 'yolo_bounding_box', delay_s):
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


def test_playback_shows_the_person_tracked_in_the_map(session, weights, tmp_path):
    """From the images of the bag alone, with the detector running: boxes, tracks and markers where the person is.

    Every five images the person is somewhere else, at once: a newcomer, who is published from the fourth image on.
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
    off_m = []
    for message in tracks.messages:
        right, _down, ahead = frames[message.header.stamp.to_nsec()].estimate_m
        for person in message.objects:
            if person.last_seen == message.header.stamp:
                place = person.pose.pose.position
                off_m.append(np.hypot(place.x - (ahead + MOUNT_M[0]), place.y + right))
    assert len(off_m) > len(tracks.messages) * 0.25 and np.percentile(off_m, 95) < 0.3
    assert all(message.objects[0].id >= 1 for message in tracks.messages if message.objects)
    drawn = set(marker.ns for message in markers.messages for marker in message.markers if marker.action == Marker.ADD)
    assert drawn == {'cylinder', 'id', 'velocity', 'prediction', 'history', 'ellipse'}


def test_a_bag_that_loops_begins_anew_with_other_numbers(tmp_path):
    """Each round of the bag both people are followed from its first half second on, and nobody of the round before."""
    path = str(tmp_path / 'people.bag')
    people = [{'start': [4.0, 0.8], 'facing': 3.1}, {'start': [5.0, -0.9], 'facing': 1.6}]
    count = write_bag(scenario_images(scenario_from({'duration': 3.0, 'rate': 10.0, 'people': people}), True), path)
    with Recorder('ros_3d_bb/tracks', TrackedObjectArray, False) as tracks, \
            launched('playback.launch', 'bag:=' + path, 'detector:=none', 'rviz:=false', 'loop:=true', 'delay:=4'):
        wait_until(lambda: len(rounds_of(tracks.messages)) == 3, 'two rounds', 60)
    numbers = [0]
    for messages in rounds_of(tracks.messages)[:2]:
        assert len(messages) > count / 2
        for message in messages[6:]:
            assert len(message.objects) == 2
        round_numbers = sorted(set(track.id for message in messages for track in message.objects))
        assert len(round_numbers) == 2 and round_numbers[0] > numbers[-1]
        numbers += round_numbers


def rounds_of(messages):
    """Messages by round: each begins where stamps go back."""
    rounds = []
    for message in list(messages):
        if not rounds or message.header.stamp < rounds[-1][-1].header.stamp:
            rounds.append([])
        rounds[-1].append(message)
    return rounds
