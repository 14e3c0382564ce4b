"""tracker_node with generated 3D boxes. Needs a master because of tf2."""
import itertools
import threading
import time

import pytest
import rospy
from dynamic_reconfigure.client import Client
from geometry_msgs.msg import TransformStamped
from tf2_msgs.msg import TFMessage
from visualization_msgs.msg import Marker, MarkerArray

from ros_3d_bb.conversions.perception_msgs import time_from
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.msg import BoundingBox3DArray, TrackedObject, TrackedObjectArray
from support.ros import TIMEOUT_S, Recorder, diagnostics_of, header_at, publisher, wait_until
from support.two_cameras import boxes

PERIOD = NS // 10
_stamps = itertools.count(1000 * NS, 100 * NS)


class Rig(object):
    """A camera that points along x of the map, on a robot."""

    def __init__(self):
        self.boxes = publisher('ros_3d_bb/bb_3d', BoundingBox3DArray)
        self.tf = publisher('/tf', TFMessage)

    def send_tf(self, stamp_ns, x=0.0, frame='camera_color_optical_frame'):
        transform = TransformStamped(header=header_at(stamp_ns, 'map'), child_frame_id=frame)
        transform.transform.translation.x, transform.transform.translation.z = x, 1.0
        turn = transform.transform.rotation
        turn.x, turn.y, turn.z, turn.w = -0.5, 0.5, -0.5, 0.5
        self.tf.publish(TFMessage([transform]))

    def send(self, stamp_ns, *centers, **robot):
        """Boxes at camera coordinates (right, down, forward), and the transform at their stamp."""
        self.send_tf(stamp_ns, **robot)
        self.send_boxes(stamp_ns, *centers)

    def stand(self, tracks, stamp_ns, frames=10):
        """Images of a person 3 m ahead; returns the track ID."""
        for frame in range(frames):
            self.send(stamp_ns + frame * PERIOD, (0.0, 0.0, 3.0))
            messages = tracks.wait_for(frame + 1)
        return messages[-1].objects[0].id

    def send_boxes(self, stamp_ns, *centers):
        self.boxes.publish(boxes(stamp_ns, 'camera_color_optical_frame', centers))


@pytest.fixture(scope='module')
def rig():
    rospy.init_node('test_tracker_node')
    return Rig()


@pytest.fixture(scope='module')
def tracks_recorder(rig):
    with Recorder('ros_3d_bb/tracks', TrackedObjectArray) as tracks:
        yield tracks


@pytest.fixture
def tracks(tracks_recorder):
    return tracks_recorder.emptied()


@pytest.fixture
def markers(rig):
    with Recorder('visualization_marker_array', MarkerArray) as markers:
        yield markers


@pytest.fixture
def now():
    """A stamp for this test; the tracks of the test before are over by then."""
    return next(_stamps)


def test_tracks_are_in_the_map_at_the_stamp_of_the_image(rig, tracks, now):
    """1 m right, 0.2 m down and 3 m in front of a camera 1 m above the map: x 3, y -1, z 0.8."""
    for frame in range(5):
        rig.send(now + frame * PERIOD, (1.0, 0.2, 3.0))
    message = tracks.wait_for(5)[-1]
    assert message.header.frame_id == 'map' and message.header.stamp == time_from(now + 4 * PERIOD)
    track, = message.objects
    place = track.pose.pose.position
    assert (place.x, place.y, place.z) == pytest.approx((3, -1, 0.8), abs=0.01)
    assert (track.size.x, track.size.y, track.size.z) == pytest.approx((0.5, 0.5, 1.7))
    assert track.id >= 1 and track.status == TrackedObject.VISIBLE and not track.moving
    assert track.first_seen == time_from(now) and track.last_seen == time_from(now + 4 * PERIOD)
    assert len(track.prediction) == 8 and track.prediction_step.to_sec() == pytest.approx(0.25)
    assert track.pose.pose.orientation.w == 1.0
    assert 0 < track.pose.covariance[0] < 0.1 and 0 < track.twist.covariance[0]
    assert track.pose.covariance[0] < track.prediction[0].covariance[0] < track.prediction[-1].covariance[0]


def test_a_standing_person_has_no_speed_while_the_robot_drives(rig, tracks, now):
    for frame in range(20):
        rig.send(now + frame * PERIOD, (0.0, 0.0, 5.0 - 0.1 * frame), x=0.1 * frame)
        tracks.wait_for(frame + 1)
    track, = tracks.wait_for(20)[-1].objects
    assert track.pose.pose.position.x == pytest.approx(5.0, abs=0.01)
    assert abs(track.twist.twist.linear.x) < 0.01 and not track.moving


def test_without_transform_nothing_is_published_and_tracks_do_not_age(rig, tracks, now):
    """For 1 s by the stamps, three times as long as a missed person is published; the track is kept."""
    number = rig.stand(tracks, now, frames=30)
    before = diagnostics_of('tracker_node')[2].get('no transform', 0)
    for quarter in range(4):
        rig.send_boxes(now + 3 * NS + quarter * NS // 4, (0.0, 0.0, 3.0))
    wait_until(lambda: diagnostics_of('tracker_node')[2].get('no transform', 0) == before + 4, 'four warnings')
    level, sentence, _counts = diagnostics_of('tracker_node')
    assert level == 1 and 'no transform from camera_color_optical_frame to map' in sentence
    assert len(tracks.messages) == 30
    rig.send(now + 4 * NS)
    assert [(track.id, track.status) for track in tracks.wait_for(31)[-1].objects] == [(number, TrackedObject.OCCLUDED)]


def test_a_late_transform_is_awaited(rig, tracks, now):
    rig.send_boxes(now, (0.0, 0.0, 3.0))
    time.sleep(0.02)
    rig.send_tf(now)
    assert tracks.wait_for(1)[0].header.stamp == time_from(now)


def test_tracks_end_after_the_limit_and_their_markers_are_deleted(rig, tracks, markers, now):
    """0.35 s after an image in which the camera should have seen the person, and did not."""
    number = rig.stand(tracks, now)
    for frame in range(10, 14):
        rig.send(now + frame * PERIOD)
        messages = tracks.wait_for(frame + 1)
    assert [len(message.objects) for message in messages[10:]] == [1, 1, 1, 0]
    assert messages[10].objects[0].status == TrackedObject.OCCLUDED
    deleted = [marker for marker in markers.wait_for(14)[-1].markers if marker.action == Marker.DELETE]
    assert sorted((marker.ns, marker.id) for marker in deleted) == [
        (namespace, number) for namespace in ('cylinder', 'ellipse', 'history', 'id')]


def test_markers_are_created_only_for_subscribers(rig, tracks, now):
    """The writer keeps the histories: none is there when it is asked for the first time in 5 s."""
    for frame in range(50):
        rig.send(now + frame * PERIOD, (0.0, 0.0, 3.0))
        tracks.wait_for(frame + 1)
    with Recorder('visualization_marker_array', MarkerArray) as markers:
        for frame in range(50, 52):
            rig.send(now + frame * PERIOD, (0.0, 0.0, 3.0))
            message = markers.wait_for(frame - 49)[-1]
            assert ('history' in [marker.ns for marker in message.markers]) == (frame > 50)


def test_a_backward_jump_in_time_deletes_all_tracks(rig, tracks, now):
    """The transforms of the time before are forgotten too, so they are sent until the boxes have met one."""
    number = rig.stand(tracks, now)
    rig.send_boxes(now - 5 * NS, (0.0, 0.0, 3.0))
    wait_until(lambda: rig.send_tf(now - 5 * NS) or len(tracks.messages) > 10, 'tracks after the jump')
    assert tracks.messages[10].header.stamp == time_from(now - 5 * NS) and not tracks.messages[10].objects
    assert rig.stand(tracks.emptied(), now - 4 * NS) > number


def test_invalid_boxes_are_rejected_and_the_next_are_tracked(rig, tracks, now):
    rig.send(now, (0.0, 0.0, float('nan')))  # not an image without people: it is not answered
    rig.send(now + PERIOD, (0.0, 0.0, 3.0))
    assert tracks.wait_for(1)[0].header.stamp == time_from(now + PERIOD)
    rig.send(now + PERIOD, (0.0, 0.0, 3.0))  # a second time
    rig.boxes.publish(BoundingBox3DArray())  # no stamp
    rig.send(now + 2 * PERIOD, (0.0, 0.0, 3.0))
    assert tracks.wait_for(2)[1].header.stamp == time_from(now + 2 * PERIOD)
    level, sentence, counts = diagnostics_of('tracker_node')
    assert level == 1 and '3D boxes rejected' in sentence and counts['3D boxes dropped'] == 1


@pytest.fixture
def tuned(rig):
    """Changes parameters; afterwards they are as they were."""
    client = Client('tracker_node', timeout=TIMEOUT_S)
    before = {name: value for name, value in client.get_configuration(TIMEOUT_S).items() if name != 'groups'}
    yield client.update_configuration
    client.update_configuration(before)
    client.close()


def test_parameters_that_are_set_together_change_together(rig, tracks, tuned, now):
    """While images come as fast as they are tracked, two pairs of values take turns: no message mixes them."""
    pairs = [{'prediction_time': 1.0, 'prediction_step': 0.1}, {'prediction_time': 3.0, 'prediction_step': 0.5}]
    both, turns, seen, over = {(10, 0.1), (6, 0.5)}, [], set(), threading.Event()

    def take_turns():
        while not over.is_set():
            tuned(dict(pairs[len(turns) % 2]))
            turns.append(None)

    rig.stand(tracks, now)
    thread = threading.Thread(target=take_turns)
    thread.start()
    for frame in range(10, 1000):
        rig.send(now + frame * PERIOD, (0.0, 0.0, 3.0))
        track, = tracks.wait_for(frame + 1)[-1].objects
        seen.add((len(track.prediction), track.prediction_step.to_sec()))
        if len(turns) > 20 and both <= seen:
            break
    over.set()
    thread.join()
    assert both <= seen <= both | {(8, 0.25)}  # that of the start
