"""ROS interface of the simulation: simulator_node, and conversion of scenarios to bags."""
