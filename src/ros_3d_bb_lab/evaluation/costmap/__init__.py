"""Benchmark of a real costmap_2d with the people of planner_bridge_node, against ground truth."""
