"""Latency benchmark under roslaunch, with the two nodes that replay images and measure latency.

May import: bags, conversions, core, msg, nodes.common, ros_3d_bb_lab.evaluation.
"""
