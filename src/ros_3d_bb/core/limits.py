"""What sizes and places of people are credible."""

LARGEST_M, FARTHEST_M = 10.0, 1e8  # nobody is wider or taller, and no map is larger
