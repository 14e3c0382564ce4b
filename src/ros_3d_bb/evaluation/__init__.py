"""What the pipeline found, against what was there."""
