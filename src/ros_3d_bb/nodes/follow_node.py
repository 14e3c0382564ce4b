"""ROS node that lets a robot follow one person."""
import threading
from typing import NamedTuple

import rospy
from actionlib_msgs.msg import GoalID
from geometry_msgs.msg import PoseStamped, Twist
from std_msgs.msg import Header, UInt32
from std_srvs.srv import SetBool, SetBoolResponse

from ros_3d_bb.conversions.perception_msgs import time_from
from ros_3d_bb.conversions.planner_msgs import pose_to_msg, velocity_to_msg
from ros_3d_bb.core.params import CLASSES_FILE, ROBOT_FRAME, TRACKS_TIMEOUT, Param, parameters
from ros_3d_bb.nodes.common.diagnostics import Diagnostics
from ros_3d_bb.nodes.common.latest_tracks import RobotTracks
from ros_3d_bb.nodes.common.reconfigure_server import ReconfigureServer
from ros_3d_bb.nodes.common.startup import read_params
from ros_3d_bb.planning.following import Follower, FollowParams, is_new_goal, is_reached
from ros_3d_bb.planning.safe_speed import SafeSpeedParams

CMD_VEL, GOAL = 'cmd_vel', 'goal'
RESENT_S = 5.0  # after this time a goal that is not reached is sent again, as move_base may have ended; chosen
PERIOD_S = 0.05  # between commands; chosen: that of move_base's controller


@parameters()
class FollowNodeParams(NamedTuple):
    output: str = Param(CMD_VEL, choices=(CMD_VEL, GOAL))
    enabled: bool = Param(False)
    robot_frame: str = ROBOT_FRAME
    timeout: float = TRACKS_TIMEOUT
    classes_file: str = CLASSES_FILE


class FollowNode(object):
    """Follow one person at a distance, by velocity commands or goals for move_base.

    The node follows the person with ~track_id, or the nearest visible one, from the moment when it is enabled. It then
    never changes to another person. The robot stops when the person has not been visible for ~lost_after, and goes on
    when the same track is visible again, or a new one that is clearly that of the person, by its place. After
    ~recover_within, or when the clock jumps back by more than 1 s, it must be enabled again.

    With ~output cmd_vel, the speed is one at which the robot can stop before all tracked people (`highest_safe_speed`),
    and no obstacles other than people are known. With ~output goal, the node does not limit the speed, which is that of
    move_base: speed_limit_node can limit it.

    If there are no tracks or no new pose of the robot for ~timeout, one zero command is published at once, and then
    nothing, as when the node is disabled or ends. With ~output goal, the goal is cancelled instead.
    Parameters: config/follow.yaml.

    Publishes
    ---------
    cmd_vel : geometry_msgs/Twist
        Velocity of the robot, 20 times per second while it follows; with ~output cmd_vel.
    move_base_simple/goal : geometry_msgs/PoseStamped
        Where the robot keeps its distance, whenever that moves, and every 5 s until it is there; with ~output goal.
    move_base/cancel : actionlib_msgs/GoalID
        Cancels the goal; with ~output goal.
    ~target : std_msgs/UInt32
        Track ID of the person, 0 while there is none, latched.

    Services
    --------
    ~enable : std_srvs/SetBool
        Chooses a person again and follows (true), or stops (false).
    """

    def __init__(self):
        self._params, follow, safety = given = read_params(FollowNodeParams, FollowParams, SafeSpeedParams)
        self._enabled, self._is_driving, self._goal, self._target = self._params.enabled, False, None, 0
        self._goal_s = 0.0  # ROS time of the goal
        self._lock, self._diagnostics = threading.Lock(), Diagnostics()
        self._follower = Follower(follow, safety)
        self._velocity_pub = rospy.Publisher('cmd_vel', Twist, queue_size=1)
        self._goal_pub = rospy.Publisher('move_base_simple/goal', PoseStamped, queue_size=1)
        self._cancel_pub = rospy.Publisher('move_base/cancel', GoalID, queue_size=1)
        self._target_pub = rospy.Publisher('~target', UInt32, queue_size=1, latch=True)
        self._target_pub.publish(UInt32(0))
        self._diagnostics.show('following', self._state)
        rospy.on_shutdown(lambda: self._on_enable(False))
        self._tracks = RobotTracks(self._diagnostics, self._params, self._on_tracks)
        rospy.Service('~enable', SetBool, lambda request: self._on_enable(request.data))
        ReconfigureServer(given, self._reconfigure)
        self._timer = rospy.Timer(rospy.Duration.from_sec(PERIOD_S), self._on_timer, reset=True)

    def _reconfigure(self, _params, follow, safety):
        with self._lock:
            self._follower.reconfigure(follow, safety)

    def _on_enable(self, enabled):
        with self._lock:
            self._enabled = enabled
            self._stop()
            self._follower.restart()
            self._publish_target()
        return SetBoolResponse(True, 'following' if enabled else 'stopped')

    def _on_tracks(self, received):
        around = self._tracks.around()
        with self._lock:
            if self._enabled and around is not None:
                self._follower.update(received.tracks, received.stamp_ns, around.robot_from_tracks)
                self._publish_target()

    def _on_timer(self, _event):
        with self._diagnostics.rejecting('commands'), self._lock:
            around = self._tracks.around() if self._enabled else None
            if around is None:
                self._stop()
            elif self._params.output == GOAL:
                self._send_goal(around)
            else:
                self._drive(around)

    def _drive(self, around):
        linear, angular = self._follower.command(around.tracks, around.age_s, around.robot_from_tracks, PERIOD_S,
                                                 around.pose_age_s)
        if self._follower.person is None and not (linear or angular):
            self._stop()
            return
        self._is_driving = True
        self._velocity_pub.publish(velocity_to_msg(linear, 0.0, angular))

    def _send_goal(self, around):
        goal = self._follower.goal(around.age_s, around.robot_from_tracks)
        if goal is None:
            self._stop()
            return
        now_s = rospy.get_time()
        is_late = now_s - self._goal_s > RESENT_S and not is_reached(goal, around.robot_from_tracks)
        if is_late or is_new_goal(self._goal, goal):
            self._is_driving, self._goal, self._goal_s = True, goal, now_s
            header = Header(stamp=time_from(around.stamp_ns), frame_id=around.frame_id)
            self._goal_pub.publish(pose_to_msg(*goal, header=header))

    def _stop(self):
        self._follower.stop()
        if self._is_driving and self._params.output == GOAL:
            self._cancel_pub.publish(GoalID())
        elif self._is_driving:
            self._velocity_pub.publish(velocity_to_msg(0.0, 0.0, 0.0))
        self._is_driving, self._goal = False, None

    def _publish_target(self):
        target = 0 if self._follower.person is None else self._follower.person.id
        if target != self._target:
            self._target = target
            self._target_pub.publish(UInt32(target))
            self._diagnostics.count('changes of the target')

    def _state(self):
        selector = self._follower.selector
        if not self._enabled:
            return 'disabled'
        if self._target:
            return 'track %d' % self._target
        if selector.target is None:
            return 'no person yet'
        return 'track %d is lost%s' % (selector.target.id, '; enable again' if selector.has_given_up else '')
