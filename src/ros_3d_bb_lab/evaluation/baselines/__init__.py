"""Baselines for comparison: the thesis' algorithms, Norfair, and an oracle."""
