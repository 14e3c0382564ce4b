"""Bags: read, write, tf of a bag, and the pipeline on a bag.

May import: camera, conversions, core, pipeline, sessions.
"""
