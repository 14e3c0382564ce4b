"""Baselines for comparison: the thesis' algorithms and Norfair."""
