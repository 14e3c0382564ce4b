"""Noise analysis of chapter 5 of the thesis for arbitrary measurements: `./run noise`.

May import: core, estimation, sessions, ros_3d_bb_lab.evaluation.
"""
