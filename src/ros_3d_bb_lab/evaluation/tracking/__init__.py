"""Tracking benchmark: trackers on simulated detections from a robot among recorded pedestrians."""
