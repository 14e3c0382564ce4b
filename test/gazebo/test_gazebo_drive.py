"""A drive with the real move_base past people: one stands in the way, two come towards the robot, one crosses behind
the goal. People in Gazebo do not avoid the robot, which sees 27 degrees to each side, so none crosses its way.
"""
import numpy as np
import rospy
from geometry_msgs.msg import PoseStamped

from ros_3d_bb.core.time_sync import NS
from ros_3d_bb_lab.simulation.gazebo_world import world_of
from ros_3d_bb_lab.simulation.scenario import scenario_from
from support.ros import header_at

ROBOT = 'jackal'
HALF_ROBOT_M = 0.254, 0.215  # half of its length and width
PERSON_M = 0.2  # radius of a person
START_S, DRIVE_S = 30.0, 40.0  # simulated time at which people start, and for the drive
SETTLING_S = 0.2  # Gazebo places people at the origin for a moment when they start
GOAL_M = 7.5, 0.0
DRIVE = scenario_from({'duration': DRIVE_S, 'room': {'bounds': [-3, 11, -4, 4]}, 'people': [
    {'start': [4.0, 0.3], 'facing': 3.1},
    {'start': [9.5, 1.5], 'facing': 3.1, 'moves': [{'to': [-2, 1.5], 'speed': 1.0}]},
    {'start': [7.5, -1.5], 'facing': 3.1, 'moves': [{'to': [-2, -1.5], 'speed': 0.7}]},
    {'start': [9.3, 2.2], 'facing': -1.6, 'moves': [{'to': [9.3, -3], 'speed': 0.5}]}]})


def clearance_m(models, yaw):
    rotation = np.array([[np.cos(yaw), np.sin(yaw)], [-np.sin(yaw), np.cos(yaw)]])
    return min(np.linalg.norm(np.maximum(np.abs(rotation.dot(place_m - models[ROBOT])) - HALF_ROBOT_M, 0))
               for name, place_m in models.items() if name != ROBOT) - PERSON_M


def test_the_robot_drives_among_people_to_its_goal_without_a_collision(start, tmp_path):
    (tmp_path / 'drive.world').write_text(world_of(DRIVE, START_S))
    with start('navigation:=true', 'world:=%s' % (tmp_path / 'drive.world')) as world:
        world.wait_for(lambda: world.goal.get_num_connections() and rospy.get_time() >= START_S, 'move_base')
        assert rospy.get_time() < START_S + 1, 'the people have moved before move_base was ready'
        goal = PoseStamped(header=header_at(int(rospy.get_time() * NS), 'odom'))
        goal.pose.position.x, goal.pose.position.y = GOAL_M
        goal.pose.orientation.w = 1.0
        world.pass_s(SETTLING_S)
        first = len(world.truth)
        world.goal.publish(goal)
        world.wait_for(lambda: rospy.get_time() > START_S + DRIVE_S or world.is_at(GOAL_M), 'the drive')
        clearances_m = [clearance_m(models, yaw) for _time_s, models, yaw in world.truth[first:]]
        print('%.1f s, clearance %.2f m' % (rospy.get_time() - START_S - SETTLING_S, min(clearances_m)))
        assert world.is_at(GOAL_M) and min(clearances_m) > 0
