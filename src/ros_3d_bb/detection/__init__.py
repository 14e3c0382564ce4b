"""2D boxes, and the detectors that find people in images."""
