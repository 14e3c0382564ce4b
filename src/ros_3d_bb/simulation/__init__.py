"""Simulation of a room with walking people and a RealSense D435i on a Jackal. Needs numpy and OpenCV only."""
