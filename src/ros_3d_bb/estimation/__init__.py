"""3D box estimation: from a 2D box and a depth image to a 3D box with its covariance."""
