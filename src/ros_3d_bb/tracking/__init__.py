"""Multi-object tracking: from 3D boxes in a fixed frame to tracks with velocity, visibility and prediction."""
