"""Benchmark of a real costmap_2d with the people of planner_bridge_node, against ground truth.

May import: camera, conversions, core, estimation, tracking, lab.evaluation, lab.simulation,
lab.simulation.ros.
"""
