"""The stages of the pipeline: ROS messages in, results out; and all of them as one object.

May import: camera, conversions, core, detection, detection.depth, detection.yolov5, estimation, tracking,
visualization.
"""
