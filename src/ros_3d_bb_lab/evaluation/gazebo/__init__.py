"""Benchmark of the pipeline on scenes in Gazebo, with a Jackal and its D435i, against the true positions of Gazebo."""
