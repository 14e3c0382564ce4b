"""Markers for RViz, overlays on images, and the window of the viewer."""
