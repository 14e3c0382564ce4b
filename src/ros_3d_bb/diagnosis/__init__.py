"""What keeps a pipeline from working, and what to do about it: from observations to sentences."""
