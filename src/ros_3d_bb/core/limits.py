"""Upper bounds of sizes and coordinates; metres."""

LARGEST_M, FARTHEST_M = 10.0, 1e8  # upper bounds of the size of an object and of coordinates
