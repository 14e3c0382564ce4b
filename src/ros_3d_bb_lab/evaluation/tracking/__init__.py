"""Tracking benchmark: trackers on simulated detections from a robot among recorded pedestrians.

May import: camera, core, estimation, tracking, ros_3d_bb_lab.evaluation, its folder baselines.
"""
