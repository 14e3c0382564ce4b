"""People in depth images without a trained network: ground plane, clusters, classifier."""
