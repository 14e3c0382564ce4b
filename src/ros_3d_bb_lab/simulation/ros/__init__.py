"""ROS interface of the simulation: simulator_node, and conversion of scenarios to bags.

May import: bags, camera, conversions, core, msg, nodes.common, ros_3d_bb_lab.simulation.
"""
