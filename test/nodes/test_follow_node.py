"""follow_node drives the simulated robot behind a person, past people who cross. Needs a master and simulated time.

People are detected in the rendered images, without weights. ROS_3D_BB_FOLLOW_S is the time of the scene.
"""
import os
import threading
import time

import numpy as np
import pytest
import rospy
from geometry_msgs.msg import Twist
from std_msgs.msg import UInt32
from std_srvs.srv import SetBool

from ros_3d_bb.msg import TrackedObjectArray
from ros_3d_bb_lab.evaluation.tracking.metrics import MATCHED_M
from support.processes import hanging
from support.ros import Recorder, launched, wait_until

FOLLOWED_S = float(os.environ.get('ROS_3D_BB_FOLLOW_S', 15))
STARTING_S, LEADER, STOP_S = 60.0, 1, 1.0
LEADER_M = 1.0  # the track of another person would be farther from the leader soon
SCENE = os.path.join(os.path.dirname(os.path.abspath(__file__)), '..', '..', 'config', 'scenarios', 'follow.yaml')


class Witness(object):
    """Compares the person that the robot follows with the truth."""

    def __init__(self):
        self._lock, self._truth, self._target = threading.Lock(), {}, 0
        self.distances_m = []  # of the followed track from the leader
        self.velocities = Recorder('cmd_vel', Twist, publisher_expected=False)
        self.collisions = Recorder('collisions', UInt32, publisher_expected=False)
        rospy.Subscriber('ground_truth', TrackedObjectArray, self._on_truth, queue_size=100)
        rospy.Subscriber('ros_3d_bb/tracks', TrackedObjectArray, self._on_tracks, queue_size=100)
        rospy.Subscriber('follow_node/target', UInt32, self._on_target, queue_size=100)

    def _on_truth(self, message):
        with self._lock:
            self._truth[message.header.stamp.to_nsec()] = message

    def _on_target(self, message):
        self._target = message.data

    def _on_tracks(self, message):
        with self._lock:
            truth = self._truth.pop(message.header.stamp.to_nsec(), None)
        followed = [track for track in message.objects if track.id == self._target]
        if truth is not None and followed:
            leader = [person for person in truth.objects if person.id == LEADER]
            self.distances_m.append(np.linalg.norm(position_of(leader[0]) - position_of(followed[0])))


def position_of(track):
    return np.array([track.pose.pose.position.x, track.pose.pose.position.y])


@pytest.fixture(scope='module')
def witness():
    with launched('simulation.launch', 'scenario:=' + SCENE, 'drive:=true', 'rviz:=false', 'single_process:=true'), \
            launched('follow.launch', 'enabled:=true'):
        witness = Witness()
        wait_until(lambda: witness.distances_m, 'a person to follow', STARTING_S)
        yield witness


def speed(witness):
    last = witness.velocities.messages[-1]
    return abs(last.linear.x) + abs(last.angular.z)


def test_the_robot_follows_the_same_person_past_others(witness):
    """While a person crosses between both, the track may stay behind the leader by 0.6 m for a second."""
    began_s = rospy.get_time()
    wait_until(lambda: rospy.get_time() - began_s >= FOLLOWED_S, 'the end of the drive', 2000.0 + 4 * FOLLOWED_S)
    distances_m = np.array(witness.distances_m)
    print('the followed track was at most %.2f m from the leader in %d images' % (distances_m.max(), len(distances_m)))
    assert (distances_m < MATCHED_M).mean() > 0.9 and distances_m.max() < LEADER_M
    assert len(distances_m) > 0.6 * FOLLOWED_S * 8
    assert not any(message.data for message in witness.collisions.messages)
    linear = np.array([message.linear.x for message in witness.velocities.messages])
    assert 0.4 < linear.max() <= 1.0 and linear.min() >= 0


def test_the_robot_stops_when_the_tracks_stop_and_the_node_is_silent(witness):
    rospy.ServiceProxy('follow_node/enable', SetBool)(True)
    wait_until(lambda: speed(witness) > 0.1, 'motion', STARTING_S)
    with hanging('people_node'):
        stopped_s = rospy.get_time()
        wait_until(lambda: speed(witness) == 0.0, 'zero velocity')
        assert rospy.get_time() - stopped_s < STOP_S
        messages = witness.velocities.messages  # slow down to zero first, while the tracks are not too old yet
        wait_until(lambda: witness.velocities.stays_at(len(messages), 1.0), 'silence')
        assert speed(witness) == 0.0
    rospy.ServiceProxy('follow_node/enable', SetBool)(True)  # the person may be lost
    wait_until(lambda: speed(witness) > 0.1, 'motion with new tracks', STARTING_S)


def test_disabling_stops_the_robot_at_once(witness):
    rospy.ServiceProxy('follow_node/enable', SetBool)(False)
    wait_until(lambda: speed(witness) == 0.0, 'zero velocity', 1.0)
    time.sleep(0.2)
    assert witness.velocities.stays_at(len(witness.velocities.messages), 0.5)
