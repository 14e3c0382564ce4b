"""tracker_node on made 3D boxes. Needs a master because it asks tf2 for the camera at the stamp of each image."""
import itertools
import time

import pytest
import rospy
from geometry_msgs.msg import Point, TransformStamped
from tf2_msgs.msg import TFMessage
from visualization_msgs.msg import Marker, MarkerArray

from ros_3d_bb.messages import time_from
from ros_3d_bb.msg import BoundingBox3D, BoundingBox3DArray, TrackedObject, TrackedObjectArray
from ros_3d_bb.stamped import NS
from support.ros import Recorder, diagnostics_of, header_at, publisher, wait_until

PERIOD = NS // 10
_stamps = itertools.count(1000 * NS, 100 * NS)


class Rig(object):
    """A camera that looks along x of the map, and a robot that carries it."""

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

    def send_boxes(self, stamp_ns, *centers):
        message = BoundingBox3DArray(header=header_at(stamp_ns))
        for center in centers:
            box = BoundingBox3D()
            box.center.position = Point(*center)
            box.center.orientation.w = 1.0
            box.size.x, box.size.y, box.size.z = 0.5, 1.7, 0.5
            message.boxes.append(box)
        self.boxes.publish(message)


@pytest.fixture(scope='module')
def rig():
    rospy.init_node('test_tracker_node')
    return Rig()


@pytest.fixture(scope='module')
def recorders(rig):
    with Recorder('ros_3d_bb/tracks', TrackedObjectArray) as tracks, \
            Recorder('visualization_marker_array', MarkerArray) as markers:
        yield tracks, markers


@pytest.fixture
def tracks(recorders):
    return recorders[0].emptied()


@pytest.fixture
def markers(recorders):
    return recorders[1].emptied()


@pytest.fixture
def now():
    """A stamp for this test; the tracks of the test before are over by then."""
    return next(_stamps)


def test_tracks_are_in_the_map_at_the_stamp_of_the_image(rig, tracks, now):
    """1 m right, 0.2 m down and 3 m in front of a camera 1 m above the map: x 3, y -1, z 0.8."""
    for frame in range(3):
        rig.send(now + frame * PERIOD, (1.0, 0.2, 3.0))
    message = tracks.wait_for(3)[-1]
    assert message.header.frame_id == 'map' and message.header.stamp == time_from(now + 2 * PERIOD)
    track, = message.objects
    place = track.pose.pose.position
    assert (place.x, place.y, place.z) == pytest.approx((3, -1, 0.8))
    assert (track.size.x, track.size.y, track.size.z) == pytest.approx((0.5, 0.5, 1.7))
    assert track.id >= 1 and track.status == TrackedObject.VISIBLE and not track.moving
    assert track.first_seen == time_from(now) and track.last_seen == time_from(now + 2 * PERIOD)
    assert len(track.prediction) == 8 and track.prediction_step.to_sec() == pytest.approx(0.25)
    assert track.pose.pose.orientation.w == 1.0


def test_a_person_who_stands_still_has_no_speed_though_the_robot_drives(rig, tracks, now):
    for frame in range(20):
        rig.send(now + frame * PERIOD, (0.0, 0.0, 5.0 - 0.1 * frame), x=0.1 * frame)
        track, = tracks.wait_for(frame + 1)[-1].objects
    assert track.pose.pose.position.x == pytest.approx(5.0)
    assert abs(track.twist.twist.linear.x) < 0.01 and not track.moving


def test_velocity_and_prediction_are_in_metres_and_seconds(rig, tracks, now):
    """1 m/s to the right of the camera is -y in the map."""
    for frame in range(40):
        rig.send(now + frame * PERIOD, (0.1 * frame, 0.0, 4.0))
        track, = tracks.wait_for(frame + 1)[-1].objects
    assert track.twist.twist.linear.y == pytest.approx(-1, abs=0.01) and track.moving
    last = track.prediction[-1].pose.position
    assert last.y - track.pose.pose.position.y == pytest.approx(-2, abs=0.02)


def test_without_transform_nothing_is_published_and_nobody_ages(rig, tracks, now):
    """Nothing for 4 s by the stamps, four times the limit; the track lives on."""
    rig.send(now, (0.0, 0.0, 3.0))
    first, = tracks.wait_for(1)
    before = diagnostics_of('tracker_node')[2].get('no transform', 0)
    for second in range(1, 5):
        rig.send_boxes(now + second * NS, (0.0, 0.0, 3.0))
    wait_until(lambda: diagnostics_of('tracker_node')[2].get('no transform', 0) == before + 4, 'four warnings')
    level, sentence, _counts = diagnostics_of('tracker_node')
    assert level == 1 and 'no transform from camera_color_optical_frame to map' in sentence
    assert len(tracks.messages) == 1
    rig.send(now + 4 * NS + PERIOD)
    again = tracks.wait_for(2)[-1]
    assert [track.id for track in again.objects] == [track.id for track in first.objects]
    assert again.objects[0].status == TrackedObject.OCCLUDED


def test_a_transform_that_comes_a_little_late_is_waited_for(rig, tracks, now):
    rig.send_boxes(now, (0.0, 0.0, 3.0))
    time.sleep(0.02)
    rig.send_tf(now)
    assert tracks.wait_for(1)[0].header.stamp == time_from(now)


def test_tracks_end_after_the_limit_and_their_markers_are_deleted(rig, tracks, markers, now):
    rig.send(now, (0.0, 0.0, 3.0))
    number = tracks.wait_for(1)[0].objects[0].id
    for frame in range(1, 12):
        rig.send(now + frame * PERIOD)
        messages = tracks.wait_for(frame + 1)
    assert [len(message.objects) for message in messages] == [1] * 11 + [0]
    assert messages[5].objects[0].status == TrackedObject.OCCLUDED
    deleted = [marker for marker in markers.wait_for(12)[-1].markers if marker.action == Marker.DELETE]
    assert sorted((marker.ns, marker.id) for marker in deleted) == [
        (namespace, number) for namespace in ('cylinder', 'id', 'prediction', 'velocity')]


def test_markers_are_those_of_the_thesis(rig, markers, tracks, now):
    """A translucent blue cylinder, its green number above, a red velocity and a green prediction arrow."""
    for frame in range(20):
        rig.send(now + frame * PERIOD, (0.0, 0.1, 2.0 + 0.1 * frame))
        tracks.wait_for(frame + 1)
    number = tracks.wait_for(20)[-1].objects[0].id
    drawn = {marker.ns: marker for marker in markers.wait_for(20)[-1].markers}
    assert set(drawn) == {'cylinder', 'id', 'velocity', 'prediction'}
    for marker in drawn.values():
        assert marker.id == number and marker.action == Marker.ADD and marker.header.frame_id == 'map'
        assert marker.header.stamp == time_from(now + 19 * PERIOD) and marker.pose.orientation.w == 1.0
    cylinder, text = drawn['cylinder'], drawn['id']
    assert cylinder.type == Marker.CYLINDER and cylinder.color.b == 1.0 and 0.2 < cylinder.color.a < 0.8
    assert (cylinder.scale.x, cylinder.scale.y, cylinder.scale.z) == pytest.approx((0.5, 0.5, 1.7))
    assert text.type == Marker.TEXT_VIEW_FACING and text.text == str(number) and text.color.g > 0.8
    assert text.pose.position.z > cylinder.pose.position.z + cylinder.scale.z / 2
    red, green = drawn['velocity'], drawn['prediction']
    assert red.type == green.type == Marker.ARROW and red.color.r > 0.8 and green.color.g > 0.8
    assert red.points[1].x - red.points[0].x == pytest.approx(1.0, abs=0.01)
    assert green.points[1].x - green.points[0].x == pytest.approx(2.0, abs=0.05)


def test_time_that_goes_back_ends_all_tracks_and_goes_on(rig, tracks, now):
    """The transforms of the time before are forgotten too, so they are sent until the boxes have met one."""
    for second in range(3):
        rig.send(now + second * NS // 2, (0.0, 0.0, 3.0))
        old = tracks.wait_for(second + 1)[-1].objects[0].id
    rig.send_boxes(now - 5 * NS, (0.0, 0.0, 3.0))
    wait_until(lambda: rig.send_tf(now - 5 * NS) or len(tracks.messages) > 3, 'a track after the jump')
    again = tracks.messages[3]
    assert again.header.stamp == time_from(now - 5 * NS) and [track.id for track in again.objects] == [old + 1]


def test_boxes_that_cannot_be_used_are_refused_and_the_next_work(rig, tracks, now):
    rig.send(now, (0.0, 0.0, float('nan')))
    rig.send(now + PERIOD, (0.0, 0.0, 3.0))
    assert tracks.wait_for(1)[0].header.stamp == time_from(now + PERIOD)
    rig.send(now + PERIOD // 2, (0.0, 0.0, 3.0))  # late
    rig.boxes.publish(BoundingBox3DArray())  # no stamp
    rig.send(now + 2 * PERIOD, (0.0, 0.0, 3.0))
    assert tracks.wait_for(2)[1].header.stamp == time_from(now + 2 * PERIOD)
    level, sentence, _counts = diagnostics_of('tracker_node')
    assert level == 1 and '3D boxes refused' in sentence
