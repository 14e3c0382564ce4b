"""The ROS nodes, one per file: parameters, subscribers and publishers only; the algorithms are in other packages."""
