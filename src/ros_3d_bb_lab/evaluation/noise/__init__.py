"""Noise analysis of chapter 5 of the thesis for arbitrary measurements: `./run noise`."""
