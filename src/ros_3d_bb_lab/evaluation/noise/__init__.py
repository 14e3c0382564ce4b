"""Noise analysis of chapter 5 of the thesis for arbitrary measurements: `./run noise`.

May import: camera, core, estimation, sessions, tracking, ros_3d_bb_lab.evaluation, its folder tracking.
"""
