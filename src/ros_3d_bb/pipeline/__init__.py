"""The stages of the pipeline (detection, estimation, tracking) without rospy, and the offline pipeline."""
