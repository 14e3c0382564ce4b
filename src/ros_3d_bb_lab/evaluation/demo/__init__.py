"""Report of a demo: an image and a table of metrics from the bag of a scene."""
