"""Conversions between ROS messages and the types of this package, without rospy."""
