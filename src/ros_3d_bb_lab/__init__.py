"""What a robot never needs: simulation, benchmarks, noise analysis. Imports ros_3d_bb, which imports none of it."""
