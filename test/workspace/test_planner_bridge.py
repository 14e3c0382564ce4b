import contextlib
import sys
from unittest import mock

import numpy as np
import pytest
import rospy
from tf2_msgs.msg import TFMessage

from ros_3d_bb.camera.camera_model import transform_from
from ros_3d_bb.conversions.camera_msgs import transform_messages
from ros_3d_bb.conversions.perception_msgs import TRACKS_TOPIC, time_from
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.msg import TrackedObjectArray
from ros_3d_bb.nodes.planner_bridge_node import PlannerBridgeNode
from support.masterless import masterless
from support.planner_definitions import package
from support.ros import header_at, person

START_NS = 1000 * NS
PACKAGES = 'people_msgs', 'costmap_converter', 'derived_object_msgs', 'vision_msgs'
POINTS, COSTS, RING = '~points', '~costs', '~clearing_points'
PEOPLE, TEB, MPC = '/people', '~obstacles', '~objects'
FIELDS = {PEOPLE: 'people', TEB: 'obstacles', MPC: 'objects'}


class Bridge(object):
    """The node, a clock, and tf: the map's origin is in front of the robot, which looks along the map's y."""

    def __init__(self, connections):
        self._connections = connections
        self.node = PlannerBridgeNode()
        self.counts = self.node._diagnostics.counts
        self.set_time(START_NS)

    def set_time(self, now_ns):
        self.now_ns, self._connections.now = now_ns, time_from(now_ns)

    def tick(self):
        for _period_s, timer in self._connections.timers:
            timer(None)

    def wait(self, duration_s):
        """Let time pass, in which each timer is called once per period."""
        began_ns = self.now_ns
        due = [(number * period_s, timer) for period_s, timer in self._connections.timers
               for number in range(1, int(duration_s / period_s + 1e-9) + 1)]
        for passed_s, timer in sorted(due, key=lambda each: each[0]):
            self.set_time(began_ns + int(passed_s * NS))
            timer(None)

    def send_tf(self, stamp_ns, child, translation):
        """The pose of a frame in the map; it is turned by a quarter to the left."""
        pose = transform_from(translation, (0, 0, 1, 1))
        self._connections.send('/tf', TFMessage(transform_messages(time_from(stamp_ns), [('map', child, pose)])))

    def send(self, stamp_ns, *tracks, frame_id='map'):
        header = header_at(stamp_ns, frame_id)
        self._connections.send(TRACKS_TOPIC, TrackedObjectArray(header=header, objects=list(tracks)))

    def count(self, topic):
        return self._connections.publishers[topic].count

    def message(self, topic):
        return self._connections.publishers[topic].newest

    def newest(self, topic):
        """Frame and content of the last message: points (n, 3), or objects."""
        message = self.message(topic)
        if topic in FIELDS:
            return message.header.frame_id, getattr(message, FIELDS[topic])
        return message.header.frame_id, np.frombuffer(message.data, '<f4').reshape(-1, 3)


@contextlib.contextmanager
def bridge_with(outputs, **params):
    stand_ins = {optional + '.msg': package(optional) for optional in PACKAGES}
    with mock.patch.dict(sys.modules, stand_ins), mock.patch('threading.Thread.start'), \
            masterless(dict(params, outputs=outputs, tf_timeout=0.0)) as found:
        yield Bridge(found)


def test_costs_are_around_the_robot_where_it_is_now():
    """Since the image it has moved by 1 m, which the layer of the costmap assumes, too."""
    with bridge_with('costmap') as bridge:
        bridge.send_tf(START_NS, 'base_link', (0, -3, 0))
        bridge.send_tf(START_NS + NS // 10, 'base_link', (0, -2, 0))
        bridge.set_time(START_NS + NS // 10)
        bridge.send(START_NS, person(1, 0, 0))
        grid = bridge.message(COSTS)
        assert (grid.header.frame_id, grid.header.stamp.to_nsec()) == ('base_link', 0)
        assert bridge.message(POINTS).header.stamp.to_nsec() == START_NS
        columns = np.reshape(grid.data, (grid.info.height, grid.info.width)).max(axis=0)
        x_m = grid.info.origin.position.x + (np.flatnonzero(columns == 99) + 0.5) * grid.info.resolution
        assert x_m.mean() == pytest.approx(2.0, abs=0.05)
        bridge.send(START_NS + NS // 10)
        assert not np.any(bridge.message(COSTS).data)


@pytest.mark.parametrize('jump_s', [-6.0, 3.1])
@pytest.mark.parametrize('clock_first', [True, False])
def test_tracks_from_before_a_jump_in_time_are_dropped_without_advice(jump_s, clock_first):
    """As where a bag or a simulated scene starts again: ROS time, or the tracks, are those of the new time first."""
    with bridge_with('people') as bridge:
        bridge.send(START_NS, person(1, 2, 0))
        after_ns = START_NS + int(jump_s * NS)
        bridge.set_time(after_ns if clock_first else START_NS)
        bridge.send(START_NS if clock_first else after_ns, person(1, 2, 0))
        assert bridge.counts['tracks from before a time jump'] == 1 and 'tracks rejected' not in bridge.counts
        bridge.set_time(after_ns)
        bridge.send(after_ns, person(1, 2, 0))
        assert bridge.counts['tracks forwarded'] == 2


def test_tracks_of_another_clock_are_rejected_with_advice():
    with bridge_with('people') as bridge:
        bridge.set_time(START_NS)
        for number in range(3):
            bridge.send(START_NS - (6 - number) * NS // 10 * 10, person(1, 2, 0))
        assert bridge.counts == {'tracks rejected': 3}


@pytest.mark.parametrize('ahead_s, expected', [(-1.1, 0), (-0.9, 1), (0.9, 1), (1.1, 0)])
def test_costs_are_withheld_where_the_robot_is_unknown(ahead_s, expected):
    """Its latest pose is further than ~timeout, 1 s, from the clock."""
    with bridge_with('costmap') as bridge:
        bridge.send_tf(START_NS + int(ahead_s * NS), 'base_link', (0, 0, 0))
        bridge.send(START_NS, person(1, 2, 0))
        assert bridge.count(COSTS) == expected


def test_an_output_waits_for_the_transform_of_its_own_frame_only():
    with bridge_with('costmap, people, teb', planner_frame='odom') as bridge:
        bridge.send_tf(START_NS, 'odom', (0, 0, 0))
        bridge.send(START_NS, person(1, 2, 0))
        assert [bridge.count(topic) for topic in (POINTS, COSTS, RING, PEOPLE, TEB)] == [0, 0, 0, 1, 1]
        assert bridge.counts['no transform'] == 2  # to base_link, at the stamp and latest
        frame_id, (obstacle,) = bridge.newest(TEB)
        place, twist = obstacle.polygon.points[0], obstacle.velocities.twist
        assert (frame_id, place.x, place.y) == ('odom', pytest.approx(0), pytest.approx(-2))
        assert (twist.linear.x, twist.linear.y) == pytest.approx((0, -1))
        bridge.send_tf(START_NS + NS // 10, 'base_link', (0, 0, 0))
        bridge.set_time(START_NS + NS // 10)
        bridge.send(START_NS + NS // 10, person(1, 2, 0))
        assert [bridge.count(topic) for topic in (POINTS, COSTS, RING, PEOPLE, TEB)] == [1, 1, 1, 2, 1]
        assert bridge.counts['no transform'] == 3


@pytest.mark.parametrize('write,failed', [(lambda *_: 1 / 0, 1), (lambda *_: 'text', 1), (lambda *_: None, 0)])
def test_an_output_that_raises_is_counted_and_the_others_are_published(write, failed):
    with bridge_with('costmap, mpc', planner_frame='map') as bridge:
        broken, = [topic for topic in bridge.node._topics if topic.output.topic == MPC]
        broken.output = broken.output._replace(write=write)
        bridge.send_tf(START_NS, 'base_link', (3, 0, 0))
        bridge.send(START_NS, person(1, 2, 0))
        assert bridge.count(POINTS) == 1 and bridge.count(MPC) == 0
        assert bridge.counts.get('outputs failed', 0) == failed and bridge.counts['tracks forwarded'] == 1


@pytest.mark.parametrize('jump_s', [-100.0, -0.5, 1.5, 100.0])
def test_a_jump_of_the_clock_empties_every_output_until_the_next_tracks(jump_s):
    with bridge_with('people, costmap') as bridge:
        bridge.send_tf(START_NS, 'base_link', (0, 0, 0))
        bridge.send(START_NS, person(1, 2, 0))
        bridge.set_time(START_NS + int(jump_s * NS))
        bridge.tick()
        bridge.tick()
        assert len(bridge.newest(POINTS)[1]) == len(bridge.newest(PEOPLE)[1]) == 0
        assert (bridge.count(POINTS), bridge.count(PEOPLE)) == (2, 2)
        for _again in range(2):  # the first after a jump back finds transforms of the time before
            bridge.send_tf(bridge.now_ns, 'base_link', (0, 0, 0))
            bridge.send(bridge.now_ns, person(1, 2, 0))
        assert len(bridge.newest(POINTS)[1]) and len(bridge.newest(PEOPLE)[1]) == 1


def test_the_empty_arrays_of_the_shutdown_are_the_last_messages():
    """A callback may be running then, and rospy calls more of them until it has closed the connections."""
    with bridge_with('people, costmap') as bridge:
        bridge.send_tf(START_NS, 'base_link', (0, 0, 0))
        bridge.send(START_NS, person(1, 2, 0))
        (on_shutdown,), _options = rospy.on_shutdown.call_args
        on_shutdown()
        bridge.send(START_NS, person(1, 2, 0))
        bridge.wait(0.3)
        assert len(bridge.newest(POINTS)[1]) == len(bridge.newest(PEOPLE)[1]) == 0
        assert not np.any(bridge.message(COSTS).data)
        assert [bridge.count(topic) for topic in (POINTS, COSTS, RING, PEOPLE)] == [2, 2, 1, 2]


def test_people_have_the_stamp_0_and_the_position_of_now():
    """The social layers transform at the stamp without waiting, and drop people for whom tf is older."""
    with bridge_with('people, teb') as bridge:
        bridge.set_time(START_NS + NS // 5)
        bridge.send(START_NS, person(1, 2, 0), person(2, float('nan'), 0))
        assert bridge.counts['tracks dropped'] == 1
        assert bridge.message(PEOPLE).header.stamp.to_nsec() == 0
        assert bridge.message(TEB).header.stamp.to_nsec() == bridge.now_ns
        assert bridge.newest(PEOPLE)[1][0].position.x == pytest.approx(2.2)
