"""ROS messages to the types of this package and back; no node, no master.

May import: camera, core, estimation, msg, tracking.
"""
