"""From boxes in a fixed frame to tracks with velocity and prediction. Nothing here knows ROS."""
