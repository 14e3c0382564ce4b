"""Benchmarks of accuracy, speed and tracking against ground truth. Free of ROS.

May import: camera, core, detection, detection.depth, detection.yolov5, estimation, sessions, tracking,
ros_3d_bb_lab.evaluation.baselines, ros_3d_bb_lab.simulation.
"""
