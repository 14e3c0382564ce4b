"""The tracking benchmark: trackers on detections of a robot among pedestrians.

May import: camera, core, tracking, ros_3d_bb_lab.evaluation, ros_3d_bb_lab.evaluation.baselines,
ros_3d_bb_lab.simulation.
"""
