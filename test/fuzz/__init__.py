"""Invalid input for parsers, conversions and the callbacks of nodes: `./run fuzz`."""
