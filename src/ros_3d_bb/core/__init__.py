"""Helpers shared by all folders: parameters, YAML, time synchronization, counters, a worker thread, atomic files."""
