"""The annotator: ground truth for measurement sessions. Needs no ROS; only the windows need Qt."""
