"""follow_node with goals for move_base, without a master."""
import numpy as np
from std_msgs.msg import Header
from tf2_msgs.msg import TFMessage

from ros_3d_bb.conversions.camera_msgs import transform_messages
from ros_3d_bb.conversions.perception_msgs import TRACKS_TOPIC, time_from, tracks_to_msg
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.nodes.follow_node import RESENT_S, FollowNode
from support.masterless import masterless
from support.tracks import track_at

START_S = 1000.0


def goals_sent(distance_m, seconds):
    """Number of goals for a robot that does not move, with a person who stands ahead."""
    with masterless({'output': 'goal', 'enabled': True}) as connections:
        FollowNode()
        for elapsed_s in np.arange(0, seconds, 0.1):
            connections.now = stamp = time_from(int((START_S + elapsed_s) * NS))
            connections.send('/tf', TFMessage(transform_messages(stamp, [('map', 'base_link', np.eye(4))])))
            track = track_at([distance_m, 0, 0.9], [0, 0, 0], moving=False)
            connections.send(TRACKS_TOPIC, tracks_to_msg([track], Header(stamp=stamp, frame_id='map')))
            for _period, on_timer in connections.timers:
                on_timer(None)
        return connections.publishers['move_base_simple/goal'].count


def test_only_a_goal_that_is_not_reached_is_sent_again():
    assert goals_sent(6.0, 3 * RESENT_S + 1) == 4
    assert goals_sent(2.0, 3 * RESENT_S + 1) == 1
