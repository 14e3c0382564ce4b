"""Cameras read without a ROS driver.

May import: camera, core.
"""
