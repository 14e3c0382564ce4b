"""Pinhole camera model, lens distortion, rigid transforms, depth images, and checks of depth-to-colour alignment."""
