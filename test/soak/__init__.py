"""The whole graph for half an hour, with faults: `./run soak`."""
