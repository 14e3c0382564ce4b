"""2D detection with YOLOv5. Nothing here knows ROS; the only place that imports torch."""
