"""3D boxes, tracks and predictions of people from an RGB-D camera on a ROS 1 robot."""
