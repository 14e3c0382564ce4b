import contextlib

import numpy as np
import pytest
from sensor_msgs.msg import LaserScan, PointCloud2, PointField
from std_msgs.msg import Header
from tf2_msgs.msg import TFMessage

from ros_3d_bb.camera.camera_model import transform_from
from ros_3d_bb.conversions.camera_msgs import transform_messages
from ros_3d_bb.conversions.perception_msgs import TRACKS_TOPIC, time_from, tracks_to_msg
from ros_3d_bb.conversions.planner_msgs import points_to_msg, velocity_to_msg
from ros_3d_bb.conversions.range_msgs import cloud_without, points_of_cloud
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.msg import TrackedObjectArray
from ros_3d_bb.nodes.follow_node import RESENT_S, FollowNode
from ros_3d_bb.nodes.people_removal_node import PeopleRemovalNode
from ros_3d_bb.nodes.speed_limit_node import SpeedLimitNode
from support.inputs import transforms
from support.masterless import masterless, on_the_wire
from support.ros import header_at, person
from support.tracks import track_at

STAMP_NS = 1000 * NS


@contextlib.contextmanager
def node_with(inputs, *people, age_ns=NS // 10, **params):
    with masterless(dict(params, inputs=inputs, tf_timeout=0.0)) as connections:
        node = PeopleRemovalNode()
        connections.now = time_from(STAMP_NS)
        connections.send('/tf', transforms(STAMP_NS))
        header = header_at(STAMP_NS - age_ns, 'map')
        connections.send(TRACKS_TOPIC, TrackedObjectArray(header=header, objects=list(people)))
        connections.counts = node._diagnostics.counts
        yield connections


def sent(connections, name, message):
    connections.send('~' + name, on_the_wire(message))
    return connections.publishers['~%s_static' % name].newest


def scan(frame_id='base_link'):
    """Three beams: right, ahead and left, of which the middle one ends at 2 m."""
    return LaserScan(header=header_at(STAMP_NS, frame_id), angle_min=-0.5, angle_increment=0.5,
                     range_max=30.0, ranges=[3.0, 2.0, 3.0])


def walking(x, y):
    """A person on whom the middle beam ends now, 0.1 s after the image."""
    return person(1, x - 0.1, y, speed=1.0)


def test_beams_that_end_at_a_person_become_nan():
    with node_with('scan', walking(2.0, 0.1)) as connections:
        found = sent(connections, 'scan', scan())
        assert np.isnan(found.ranges).tolist() == [False, True, False] and found.header == scan().header
        assert connections.counts['scan without people'] == 1


PERIOD_S, RATE = 1 / 5.5, 1.0  # of a slow laser, on a robot that turns


def seen_while_turning(person_m, walks_mps=0.0):
    """Full scan (n,) of a person, from the back to the left; the laser turns by 0.18 rad meanwhile. The person walks
    along x. None of the beams is nearer, all others are infinite."""
    later_s = PERIOD_S / 720 * np.arange(720)
    angles = -np.pi + 2 * np.pi / 720 * np.arange(720) + RATE * later_s
    along = person_m[0] + walks_mps * later_s, person_m[1]
    middle_m = along[0] * np.cos(angles) + along[1] * np.sin(angles)
    beside2 = along[0] ** 2 + along[1] ** 2 - middle_m ** 2
    return np.where((middle_m > 0) & (beside2 < 0.25 ** 2), middle_m - np.sqrt(np.maximum(0.0625 - beside2, 0)), np.inf)


@pytest.mark.parametrize('bearing_deg', [30, 150])
@pytest.mark.parametrize('walks_mps', [0.0, 2.0])
def test_beams_are_removed_at_the_pose_of_each_beam(bearing_deg, walks_mps):
    person_m = 4.0 * np.cos(np.radians(bearing_deg)), 4.0 * np.sin(np.radians(bearing_deg))
    ranges_m = seen_while_turning(person_m, walks_mps)
    message = LaserScan(header=header_at(STAMP_NS, 'base_link'), angle_min=-np.pi,
                        angle_increment=2 * np.pi / 720, time_increment=PERIOD_S / 720, ranges=ranges_m.tolist())
    with node_with('scan', person(1, *person_m, speed=walks_mps), age_ns=0) as connections:
        one_pose = sent(connections, 'scan', message).ranges
        assert connections.counts['scan at one pose'] == 1
        for later_s in np.arange(0, 0.21, 0.02):
            turned = transform_from((0, 0, 0), (0, 0, np.sin(RATE * later_s / 2), np.cos(RATE * later_s / 2)))
            connections.send('/tf', TFMessage(transform_messages(
                time_from(STAMP_NS + int(later_s * NS)), [('map', 'base_link', turned)])))
        moving = sent(connections, 'scan', message).ranges
        assert np.isfinite(ranges_m).sum() > 10 and not np.isfinite(moving).any()
        assert np.isfinite(one_pose).any()


@pytest.mark.parametrize('frame_id, age_ns, counter', [
    ('base_link', NS, 'no recent tracks'), ('nowhere', NS // 10, 'no transform')])
def test_measurements_pass_where_it_is_unknown_where_people_are(frame_id, age_ns, counter):
    with node_with('scan', walking(2.0, 0.1), age_ns=age_ns) as connections:
        assert sent(connections, 'scan', scan(frame_id)).ranges == (3.0, 2.0, 3.0)
        assert connections.counts[counter] == 1


@pytest.mark.parametrize('height', [1, 2])
def test_points_of_people_are_dropped_or_nan_in_an_organised_cloud(height):
    points = np.array([[2.0, 0.1, 0.5], [4.0, 0.1, 0.5], [2.0, 2.0, 0.5], [2.0, 0.0, 1.0]])
    cloud = points_to_msg(points, header_at(STAMP_NS, 'base_link'))
    cloud.height, cloud.width = height, 4 // height
    cloud.row_step = cloud.width * cloud.point_step
    with node_with('points', walking(2.0, 0.1)) as connections:
        found = sent(connections, 'points', cloud)
    left = points_of_cloud(found)
    if height == 1:
        np.testing.assert_allclose(left, points[1:3])
    else:
        assert np.isnan(left).all(axis=1).tolist() == [True, False, False, True] and not found.is_dense
        np.testing.assert_allclose(left[1:3], points[1:3])


def test_a_cloud_of_another_layout_passes_as_it_is_also_where_people_are():
    """With gaps between the rows. A costmap that received it only without people would be blind beside them."""
    cloud = points_to_msg(np.array([[2.0, 0.1, 0.5]]), header_at(STAMP_NS, 'base_link'))
    cloud.row_step, cloud.data = 16, cloud.data + bytes(4)
    with node_with('points', walking(2.0, 0.1)) as connections:
        assert sent(connections, 'points', cloud) == cloud and connections.counts['points with people'] == 1


def test_other_fields_of_a_cloud_are_kept():
    kind = np.dtype([('rgb', '<u4'), ('x', '<f4'), ('y', '<f4'), ('z', '<f4')])
    points = np.array([(7, 1, 2, 3), (8, 4, 5, 6)], kind)
    fields = [PointField('rgb', 0, PointField.UINT32, 1)] + [
        PointField(name, 4 * number, PointField.FLOAT32, 1) for number, name in enumerate('xyz', 1)]
    cloud = PointCloud2(height=1, width=2, fields=fields, point_step=16, row_step=32, data=points.tobytes())
    np.testing.assert_allclose(points_of_cloud(cloud), [[1, 2, 3], [4, 5, 6]])
    assert np.frombuffer(cloud_without(cloud, np.array([True, False])).data, kind).tolist() == [(8, 4, 5, 6)]


START_NS = 1000 * NS


class Robot(object):
    """The node, and tf, in which the robot is at the origin of the map."""

    def __init__(self, connections):
        self._connections, self.counts = connections, SpeedLimitNode()._diagnostics.counts

    def send_tf(self, stamp_ns, topic='/tf'):
        links = transform_messages(time_from(stamp_ns), [('map', 'base_link', np.eye(4))])
        self._connections.send(topic, TFMessage(links))

    def forwarded(self, now_ns, *tracks, frame_id='map'):
        """Speed of the command that is forwarded for one of 1 m/s ahead."""
        self._connections.now = time_from(now_ns)
        header = header_at(now_ns, frame_id)
        self._connections.send(TRACKS_TOPIC, tracks_to_msg(tracks, header))
        self._connections.send('cmd_vel_in', velocity_to_msg(1.0, 0.0, 0.0))
        return self._connections.publishers['cmd_vel'].newest.linear.x

    def limit(self):
        (_period_s, on_timer), = self._connections.timers
        on_timer(None)
        return self._connections.publishers['~speed_limit'].newest.data


@contextlib.contextmanager
def robot_with(**params):
    with masterless(params) as connections:
        yield Robot(connections)


@pytest.mark.parametrize('age_s, expected', [
    (-3.0, 0.0), (-0.6, 0.0), (-0.3, 1.0), (0.4, 1.0), (0.6, 0.0), (600.0, 0.0)])
def test_a_robot_with_a_pose_of_another_time_stands(age_s, expected):
    """As where the localisation has ended, and cameras on the walls see the people, or its machine has another clock:
    with a pose 3 s ahead, the robot would not notice for 3 s that it is no longer updated."""
    with robot_with() as robot:
        robot.send_tf(START_NS)
        assert robot.forwarded(START_NS + int(age_s * NS)) == expected
        assert ('no transform' in robot.counts) == (expected == 0)
        now_ns = START_NS + max(int(age_s * NS), 0) + NS // 100
        robot._connections.now = time_from(now_ns)
        robot.send_tf(now_ns)
        assert robot.forwarded(now_ns) == 1.0


def test_the_robot_has_moved_on_since_its_latest_pose():
    """The person leaves 1.5 m: 0.25 m of the body, and the robot and the clearance, of 2.2 m."""
    standing = track_at([2.2, 0, 0.9], [0, 0, 0], moving=False)
    with robot_with(highest_speed=2.0) as robot:
        robot.send_tf(START_NS)
        robot.forwarded(START_NS + 4 * NS // 10, standing)
        speed_mps = robot.limit()
        assert 1.3 < (0.4 + 0.3) * speed_mps + speed_mps ** 2 / 2 <= 1.5


def test_the_robot_stops_before_the_whole_length_of_a_bicycle():
    """Its length is 1.75 m, half of which, and the robot and the clearance, leave 1.175 m."""
    standing = track_at([2.5, 0, 0.5], [0, 0, 0], moving=False)
    bicycle = standing._replace(label='bicycle', size_m=np.array([0.6, 0.6, 1.1]))
    with robot_with(highest_speed=2.0) as robot:
        robot.send_tf(START_NS)
        robot.forwarded(START_NS, bicycle)
        speed_mps = robot.limit()
        assert 1.0 < 0.3 * speed_mps + speed_mps ** 2 / 2 <= 1.175


def goals_sent(distance_m, seconds):
    """Number of goals for a robot that does not move, with a person who stands ahead."""
    with masterless({'output': 'goal', 'enabled': True}) as connections:
        FollowNode()
        for elapsed_s in np.arange(0, seconds, 0.1):
            connections.now = stamp = time_from(START_NS + int(elapsed_s * NS))
            connections.send('/tf', TFMessage(transform_messages(stamp, [('map', 'base_link', np.eye(4))])))
            track = track_at([distance_m, 0, 0.9], [0, 0, 0], moving=False)
            connections.send(TRACKS_TOPIC, tracks_to_msg([track], Header(stamp=stamp, frame_id='map')))
            for _period, on_timer in connections.timers:
                on_timer(None)
        return connections.publishers['move_base_simple/goal'].count


def test_only_a_goal_that_is_not_reached_is_sent_again():
    assert goals_sent(6.0, 3 * RESENT_S + 1) == 4
    assert goals_sent(2.0, 3 * RESENT_S + 1) == 1


@pytest.mark.parametrize('range_m, expected', [(5.0, 2.0), (0.0, 0.3), (np.nan, 0.3)])
def test_a_scan_without_information_limits_the_speed_as_no_scan_does(range_m, expected):
    with masterless({'use_scan': True}) as connections:
        robot, connections.now = Robot(connections), time_from(START_NS)
        robot.send_tf(START_NS)
        connections.send('scan', LaserScan(
            header=Header(stamp=connections.now, frame_id='base_link'), angle_min=-1.5, angle_increment=0.01,
            range_min=0.1, range_max=10.0, ranges=[range_m] * 301))
        robot.forwarded(START_NS)
        assert robot.limit() == pytest.approx(expected) and ('scans rejected' in robot.counts) == (expected < 2)
