"""The ROS nodes, one per file: parameters, subscribers and publishers only; the algorithms are in other packages.

May import: bags, camera, conversions, core, detection, detection.depth, detection.yolov5, diagnosis, drivers, msg,
nodes.common, pipeline, planning, sessions, tracking, visualization.
"""
