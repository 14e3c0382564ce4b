"""Typical size of a person, and upper bounds of sizes and coordinates; metres."""

LARGEST_M, FARTHEST_M = 10.0, 1e8  # upper bounds of the size of an object and of coordinates
USUAL_WIDTH_M, USUAL_HEIGHT_M = 0.46, 1.7  # of a person, to complete truncated boxes
