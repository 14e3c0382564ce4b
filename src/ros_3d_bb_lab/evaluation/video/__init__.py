"""Benchmark of the pipeline on RGB-D videos with marked people."""
