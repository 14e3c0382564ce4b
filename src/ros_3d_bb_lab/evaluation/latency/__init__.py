"""The latency benchmark under roslaunch, with its two rig nodes.

May import: bags, conversions, core, msg, nodes.common, ros_3d_bb_lab.evaluation.
"""
