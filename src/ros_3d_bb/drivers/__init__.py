"""Cameras read without a ROS driver."""
