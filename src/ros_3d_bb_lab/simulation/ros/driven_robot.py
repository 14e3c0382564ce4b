"""ROS interface of the simulated robot: transforms, velocity commands, odometry, scans and collisions."""
import rospy
from geometry_msgs.msg import Point, Quaternion, Twist
from nav_msgs.msg import Odometry
from sensor_msgs.msg import LaserScan
from std_msgs.msg import Float32, Header, UInt32
from tf2_msgs.msg import TFMessage

from ros_3d_bb.camera.camera_model import quaternion_from
from ros_3d_bb.conversions.camera_msgs import transform_messages
from ros_3d_bb_lab.simulation.driven_world import DrivenWorld
from ros_3d_bb_lab.simulation.laser import RANGE_M
from ros_3d_bb_lab.simulation.ros.scenario_to_bag import BASE_FRAME, ODOM_FRAME, transforms_of

QUEUE_SIZE = 100  # messages of a second, for subscribers that are briefly busy


class DrivenRobot(object):
    """ROS interface of a DrivenWorld, which is created anew for each round of the scene."""

    def __init__(self, simulator, diagnostics):
        self._simulator, self._diagnostics = simulator, diagnostics
        self._world, self._reported = DrivenWorld(simulator), 0
        self._odom_pub = rospy.Publisher('odom', Odometry, queue_size=QUEUE_SIZE)
        self._collisions_pub = rospy.Publisher('collisions', UInt32, queue_size=1, latch=True)
        self._clearance_pub = rospy.Publisher('clearance', Float32, queue_size=QUEUE_SIZE)
        rospy.Subscriber('cmd_vel', Twist, self._on_command, queue_size=1)

    def restarted(self):
        self._world, self._reported = DrivenWorld(self._simulator), 0
        self._collisions_pub.publish(UInt32(0))
        return self._world

    def publish(self, state, stamp):
        """Publish odometry and clearance in a state, and report new collisions."""
        self._odom_pub.publish(odometry_message(self._simulator, state, self._world.odometry_velocity, stamp))
        self._clearance_pub.publish(Float32(self._world.clearance_m))
        for collision in self._world.collisions[self._reported:]:
            self._reported += 1
            self._diagnostics.count('collisions')
            rospy.logwarn('collision %d, %.2f s after the start: the robot touches %s at %.2f m/s', self._reported,
                          collision.time_s, collision.object, collision.speed_mps)
            self._collisions_pub.publish(UInt32(self._reported))

    def _on_command(self, message):
        try:
            self._world.command(message.linear.x, message.angular.z)
        except ValueError as error:
            self._diagnostics.warn('invalid commands', 'invalid command: %s; it is ignored' % error)


def robot_transforms(simulator, state, stamp):
    """Convert a WorldState to one TFMessage from the map to all cameras."""
    links = []
    for index, name in enumerate(simulator.camera_names):
        chain = transforms_of(simulator.poses(state, index), name)
        links += chain[-1:] if links else chain
    return TFMessage(transform_messages(stamp, links))


def odometry_message(simulator, state, velocity, stamp):
    """Convert a WorldState to Odometry. `velocity` is the measured linear and angular velocity."""
    odom_from_base = simulator.poses(state).odom_from_base
    message = Odometry(header=Header(stamp=stamp, frame_id=ODOM_FRAME), child_frame_id=BASE_FRAME)
    message.pose.pose.position = Point(*odom_from_base[:3, 3].tolist())
    message.pose.pose.orientation = Quaternion(*quaternion_from(odom_from_base).tolist())
    message.twist.twist.linear.x, message.twist.twist.angular.z = (float(part) for part in velocity)
    return message


def scan_to_msg(ranges_m, field_of_view, stamp):
    """Convert ranges (n,) to a LaserScan in the frame of the robot."""
    return LaserScan(header=Header(stamp=stamp, frame_id=BASE_FRAME), angle_min=-field_of_view / 2,
                     angle_max=field_of_view / 2, angle_increment=field_of_view / (len(ranges_m) - 1),
                     range_min=0.05, range_max=RANGE_M, ranges=ranges_m.tolist())
