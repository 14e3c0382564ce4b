"""Benchmarks of accuracy, speed and tracking against ground truth. Free of ROS."""
