"""Closed-loop benchmark: move_base drives the simulated robot among people.

May import: camera, conversions, core, msg, nodes.common, tracking, lab.evaluation, lab.simulation,
lab.simulation.ros.
"""
