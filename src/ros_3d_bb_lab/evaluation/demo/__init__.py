"""Report of a demo: an image and a table of metrics from the bag of a scene.

May import: conversions, core, tracking, visualization, ros_3d_bb_lab.evaluation, ros_3d_bb_lab.simulation.ros.
"""
