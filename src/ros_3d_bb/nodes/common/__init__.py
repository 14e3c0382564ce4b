"""Modules shared by the nodes: parameters, subscribers, tf lookup, diagnostics, reconfigure, ROS master.

May import: camera, conversions, core, diagnosis, msg, pipeline, visualization.
"""
