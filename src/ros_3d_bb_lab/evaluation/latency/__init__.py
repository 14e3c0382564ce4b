"""Latency benchmark under roslaunch, with the two nodes that replay images and measure latency."""
