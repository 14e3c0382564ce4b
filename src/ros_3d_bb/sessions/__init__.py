"""Measurement sessions on disk: read, write, and collect the images and boxes of one stamp."""
