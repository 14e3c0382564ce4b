"""The ROS nodes: parameters, subscribers and publishers, and no mathematics. The only place that imports rospy."""
