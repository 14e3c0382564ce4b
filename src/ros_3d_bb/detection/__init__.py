"""2D detection: YOLOv5 in colour images, and people in depth images. Free of ROS; only this package imports torch."""
