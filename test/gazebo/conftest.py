"""gazebo.launch with the real Gazebo, the Jackal, its controllers and its EKF, without windows.

Time is simulated: a slow computer needs longer, but sees the same.
"""
import bisect
import contextlib
import subprocess

import numpy as np
import pytest
import rospy
from gazebo_msgs.msg import ModelStates
from geometry_msgs.msg import PoseStamped

from ros_3d_bb.msg import TrackedObjectArray
from ros_3d_bb_lab.evaluation.launching import running
from support.processes import processes_naming
from support.ros import Recorder, launched, wait_until

FPS = 10
PATIENCE_S = 600.0  # wall-clock time
ROBOT = 'jackal'


class World(object):
    """True positions of the people and of the robot, and the topics of the robot."""

    def __init__(self):
        self.fps, self.truth = FPS, []  # (time in s, {name: (2,)}, yaw of the robot)
        rospy.Subscriber('gazebo/model_states', ModelStates, self._on_states, queue_size=1, buff_size=2 ** 20)
        self.tracks = Recorder('ros_3d_bb/tracks', TrackedObjectArray, publisher_expected=False)
        self.goal = rospy.Publisher('move_base_simple/goal', PoseStamped, queue_size=1)

    def _on_states(self, message):
        models = {name: np.array([pose.position.x, pose.position.y]) for name, pose in zip(message.name, message.pose)
                  if name not in ('floor', 'room')}
        if ROBOT in models:
            turned = message.pose[message.name.index(ROBOT)].orientation
            self.truth.append((rospy.get_time(), models, 2 * np.arctan2(turned.z, turned.w)))

    def positions_at(self, time_s, name):
        return self.truth[min(bisect.bisect(self.truth, (time_s,)), len(self.truth) - 1)][1][name]

    def wait_for(self, condition, what):
        wait_until(condition, what, PATIENCE_S)

    def pass_s(self, seconds):
        end_s = rospy.get_time() + seconds
        self.wait_for(lambda: rospy.get_time() >= end_s, '%g s of simulated time' % seconds)

    def is_at(self, place_m):
        return np.hypot(*(self.truth[-1][1][ROBOT] - place_m)) < 0.5


@pytest.fixture(scope='session')
def start(weights):
    """Function that starts gazebo.launch with arguments, and returns a context with its World."""
    @contextlib.contextmanager
    def started(*arguments):
        with launched('gazebo.launch', 'gui:=false', 'rviz:=false', 'lockstep:=true', 'weights:=' + weights,
                      'fps:=%d' % FPS, *arguments) as nodes:
            world = World()
            wait_until(lambda: nodes.poll() is not None or world.tracks.messages, 'tracks', PATIENCE_S)
            assert nodes.poll() is None, 'roslaunch has exited'
            yield world
        wait_until(lambda: not processes_naming('libgazebo_ros_api_plugin'), 'the end of Gazebo', PATIENCE_S)
    with running(['roscore']):
        subprocess.check_call('until rosparam set use_sim_time true; do sleep 1; done', shell=True)
        rospy.init_node('test_gazebo')
        yield started
