"""speed_limit_node and follow_node without a master: which commands pass, and when goals are sent again."""
import contextlib

import numpy as np
import pytest
from std_msgs.msg import Header
from tf2_msgs.msg import TFMessage

from ros_3d_bb.conversions.camera_msgs import transform_messages
from ros_3d_bb.conversions.perception_msgs import TRACKS_TOPIC, time_from, tracks_to_msg
from ros_3d_bb.conversions.planner_msgs import velocity_to_msg
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.nodes.follow_node import RESENT_S, FollowNode
from ros_3d_bb.nodes.speed_limit_node import SpeedLimitNode
from support.masterless import masterless
from support.tracks import track_at

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
        header = Header(stamp=time_from(now_ns), frame_id=frame_id)
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


@pytest.mark.parametrize('age_s, expected', [(-0.3, 1.0), (0.4, 1.0), (0.6, 0.0), (600.0, 0.0)])
def test_a_robot_whose_pose_is_no_longer_updated_stands(age_s, expected):
    """As where the localisation has ended, and cameras on the walls see the people."""
    with robot_with() as robot:
        robot.send_tf(START_NS)
        assert robot.forwarded(START_NS + int(age_s * NS)) == expected
        assert ('old transform' in robot.counts) == (expected == 0)
        robot.send_tf(START_NS + int(age_s * NS))
        assert robot.forwarded(START_NS + int(age_s * NS) + NS // 100) == 1.0


def test_static_transforms_and_those_between_equal_frames_do_not_age():
    with robot_with() as robot:
        robot.send_tf(START_NS, '/tf_static')
        assert robot.forwarded(START_NS + 600 * NS) == 1.0
    with robot_with() as robot:
        robot.send_tf(START_NS)
        assert robot.forwarded(START_NS + 600 * NS, frame_id='/base_link') == 1.0


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
