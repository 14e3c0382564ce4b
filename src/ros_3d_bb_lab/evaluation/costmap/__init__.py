"""Benchmark of a real costmap_2d with the people of planner_bridge_node, against ground truth.

May import: bags, camera, conversions, core, msg, nodes.common, lab.evaluation, lab.simulation, lab.simulation.ros.
"""
