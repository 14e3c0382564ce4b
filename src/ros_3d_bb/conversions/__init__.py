"""Conversions between ROS messages and the types of this package, without rospy.

May import: camera, core, estimation, msg, tracking.
"""
