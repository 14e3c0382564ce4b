"""Markers for RViz, overlays on images, and the window of the viewer.

May import: camera, core, estimation, tracking.
"""
