"""A simulated room with walking people, seen by a RealSense D435i on a Jackal; free of ROS."""
