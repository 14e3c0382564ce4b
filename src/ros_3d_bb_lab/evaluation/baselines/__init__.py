"""What this package is compared with: the thesis' algorithms, Norfair, and an oracle.

May import: camera, core, tracking.
"""
