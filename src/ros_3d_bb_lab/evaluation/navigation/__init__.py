"""Closed-loop benchmark: move_base drives the simulated robot among people."""
