"""A stand-in for a robot that obeys cmd_vel, its localisation, and its camera, on simulated time."""
import time

import numpy as np
import rospy
from geometry_msgs.msg import Twist
from nav_msgs.msg import OccupancyGrid, Odometry
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import PointCloud2
from tf2_msgs.msg import TFMessage

from ros_3d_bb.camera.camera_model import OPTICAL_ROTATION, transform_from, transform_points
from ros_3d_bb.conversions.camera_msgs import transform_messages
from ros_3d_bb.conversions.perception_msgs import time_from
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.msg import BoundingBox3DArray, TrackedObjectArray
from ros_3d_bb_lab.simulation.driven_world import moved
from ros_3d_bb_lab.simulation.simulator import upright
from support.ros import Recorder, header_at
from support.two_cameras import boxes

TICK_NS, PERIOD_NS = NS // 100, NS // 10
CAMERA, BASE_FROM_CAMERA = 'camera_color_optical_frame', transform_from((0.17, 0, 0.2), OPTICAL_ROTATION)
DRIFT = 0.03, -0.02, 0.02  # of odom in the map: x, y (m/s) and yaw (rad/s)
PATIENCE_S = 1.0  # real time, for an answer
COSTMAP_NS = 4 * NS // 10  # longest time between costmaps
FAULTY_SPEED = 4.0


def level(x, y, yaw):
    return upright(x, y, 0, yaw)


class DrivenRobot(object):
    """The robot starts at the origin of the map and looks along x. Its localisation and odometry publish tf at 10 Hz.

    `people` is a function from seconds to positions (n, 2) in the map. `velocity` is that of the last cmd_vel. Time
    waits for the answers of the bridge and of move_base, so that a busy machine does not look like a fault. While
    `is_faulty`, time does not wait for the bridge and runs faster than real time, so that a killed node is missing for
    long enough.
    """

    def __init__(self):
        self.now_ns, self.people, self.sees = 1000 * NS, lambda _time_s: np.zeros((0, 2)), True
        self.is_faulty = False
        self.velocity, self.commands, self._pose, self._cmd = 0.0, 0, np.zeros(3), np.zeros(2)
        self._sent_ns, self._answered, self._commands = None, True, 0
        self._clock_pub = rospy.Publisher('/clock', Clock, queue_size=10)
        self._tf_pub = rospy.Publisher('/tf', TFMessage, queue_size=10)
        self._odom_pub = rospy.Publisher('odometry/filtered', Odometry, queue_size=10)
        self._boxes_pub = rospy.Publisher('ros_3d_bb/bb_3d', BoundingBox3DArray, queue_size=10)
        self._map_pub = rospy.Publisher('map', OccupancyGrid, queue_size=1, latch=True)
        self._map_pub.publish(self._empty_map())
        rospy.Subscriber('cmd_vel', Twist, self._on_cmd_vel, queue_size=1)
        self.tracks = Recorder('ros_3d_bb/tracks', TrackedObjectArray, publisher_expected=False)
        self.ring = Recorder('planner_bridge_node/clearing_points', PointCloud2, publisher_expected=False)
        self.costmap = Recorder('move_base/local_costmap/costmap', OccupancyGrid, publisher_expected=False)

    @staticmethod
    def _empty_map():
        message = OccupancyGrid(header=header_at(0, 'map'), data=[0] * 400 * 400)
        message.info.width = message.info.height = 400
        message.info.resolution, message.info.origin.orientation.w = 0.1, 1.0
        message.info.origin.position.x = message.info.origin.position.y = -20.0
        return message

    @property
    def seconds(self):
        return (self.now_ns - 1000 * NS) / NS

    @property
    def place_m(self):
        """Position (2,) of the robot in the map."""
        return np.linalg.inv(self.odom_from_map(self.seconds)).dot(level(*self._pose))[:2, 3]

    def _on_cmd_vel(self, message):
        self._cmd = np.array([message.linear.x, message.angular.z])
        self.velocity, self.commands = abs(self._cmd).max(), self.commands + 1

    def odom_from_map(self, seconds):
        """Drift of the odometry at a time."""
        return np.linalg.inv(level(*np.multiply(DRIFT, seconds)))

    def advance(self, seconds, is_driven=True):
        """Let time pass, with 10 images a second if the camera sees; `is_driven`: move_base has a goal."""
        for _step in range(int(round(10 * seconds))):
            self._send_tf()  # first: the tracker needs it for the boxes before
            if self.costmap.messages:
                self._wait_for(lambda: (self.commands > self._commands or not is_driven)
                               and self.now_ns - _newest_ns(self.costmap) < COSTMAP_NS)
            self._commands = self.commands
            for tick in range(PERIOD_NS // TICK_NS):
                self.now_ns += TICK_NS
                self._clock_pub.publish(Clock(time_from(self.now_ns)))
                self._pose = moved(self._pose, self._cmd, TICK_NS / NS)
                time.sleep(TICK_NS / NS / (FAULTY_SPEED if self.is_faulty else 1))
                if tick == 2 and self.sees:
                    self._send_boxes()

    def _send_tf(self):
        stamp_ns = self.now_ns
        map_from_odom, odom_from_base = np.linalg.inv(self.odom_from_map(self.seconds)), level(*self._pose)
        links = transform_messages(time_from(stamp_ns), [('map', 'odom', map_from_odom), (
            'odom', 'base_link', odom_from_base), ('base_link', CAMERA, BASE_FROM_CAMERA)])
        self._tf_pub.publish(TFMessage(links))
        odometry = Odometry(header=header_at(stamp_ns, 'odom'), child_frame_id='base_link')
        odometry.pose.pose.position.x, odometry.pose.pose.position.y = self._pose[:2]
        odometry.pose.pose.orientation = links[1].transform.rotation
        odometry.twist.twist.linear.x, odometry.twist.twist.angular.z = self._cmd
        self._odom_pub.publish(odometry)

    def _send_boxes(self):
        """The boxes of the people in front of the camera, once the bridge has answered the last ones."""
        if self._sent_ns and self._answered and not self.is_faulty:
            self._answered = self._wait_for(lambda: _newest_ns(self.ring) >= self._sent_ns)
        self._answered |= bool(self._sent_ns) and _newest_ns(self.ring) >= self._sent_ns
        map_from_camera = np.linalg.inv(self.odom_from_map(self.seconds)).dot(level(*self._pose)).dot(BASE_FROM_CAMERA)
        people_m = np.asarray(self.people(self.seconds)).reshape(-1, 2)
        centers_m = transform_points(np.linalg.inv(map_from_camera), np.c_[people_m, np.full(len(people_m), 0.85)])
        self._boxes_pub.publish(boxes(self.now_ns, CAMERA, [tuple(center_m) for center_m in centers_m
                                                            if center_m[2] > 0.5]))
        self._sent_ns = self.now_ns

    @staticmethod
    def _wait_for(condition):
        deadline_s = time.monotonic() + PATIENCE_S
        while not condition() and time.monotonic() < deadline_s:
            time.sleep(0.002)
        return condition()


def _newest_ns(recorder):
    messages = recorder.messages
    return messages[-1].header.stamp.to_nsec() if messages else 0
