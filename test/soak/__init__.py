"""Soak test of the whole graph with faults: `./run soak`."""
