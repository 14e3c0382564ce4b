"""Helpers that every room shares: parameters, YAML, stamps, counters, a worker thread, atomic files.

May import: nothing of this package.
"""
