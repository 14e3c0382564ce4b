"""The pinhole camera, lens distortion, rigid transforms, and whether depth is aligned to colour.

May import: core.
"""
