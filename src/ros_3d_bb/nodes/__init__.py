"""The ROS nodes, one in each file: parameters, subscribers and publishers, no mathematics.

May import: bags, camera, conversions, core, detection.depth, detection.yolov5, diagnosis, drivers, msg, nodes.common,
pipeline, planning, sessions, tracking, visualization.
"""
