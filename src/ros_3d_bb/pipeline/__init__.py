"""The stages of the pipeline (detection, estimation, tracking) without rospy, and the offline pipeline.

May import: camera, conversions, core, detection, detection.depth, detection.yolov5, estimation, tracking,
visualization.
"""
