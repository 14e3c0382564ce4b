"""Upper bounds of sizes and coordinates; metres."""

MAX_SIZE_M, MAX_COORDINATE_M = 10.0, 1e8  # chosen: objects and maps of no robot are larger
