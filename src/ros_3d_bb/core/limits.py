"""Sizes of people, and the largest sizes and coordinates that are accepted; metres."""

LARGEST_M, FARTHEST_M = 10.0, 1e8  # no object is larger, and no map
USUAL_WIDTH_M, USUAL_HEIGHT_M = 0.46, 1.7  # of a person; for the part that the image border cuts off
