"""Annotator of ground truth in measurement sessions. Works without ROS; only the windows need Qt."""
