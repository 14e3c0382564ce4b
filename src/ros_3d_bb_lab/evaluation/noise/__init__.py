"""The noise analysis of the thesis' chapter 5, for any measurements: `./run noise`.

May import: estimation, sessions, ros_3d_bb_lab.evaluation.
"""
