"""The report of a demo: a picture and a table from the bag of a scene.

May import: conversions, core, tracking, visualization, ros_3d_bb_lab.evaluation, ros_3d_bb_lab.simulation.ros.
"""
