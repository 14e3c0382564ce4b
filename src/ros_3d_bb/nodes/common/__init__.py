"""Modules shared by the nodes: parameters, subscribers, tf lookup, diagnostics, reconfigure, ROS master."""
