"""The simulation as ROS messages: simulator_node, and scenarios as bags.

May import: bags, camera, conversions, core, msg, nodes.common, ros_3d_bb_lab.simulation.
"""
