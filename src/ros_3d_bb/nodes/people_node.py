"""ROS node that detects, locates and tracks people: the nodes of the pipeline in one process."""
from typing import NamedTuple

import rospy

from ros_3d_bb.core.latest_worker import NewestWorker
from ros_3d_bb.core.params import Param, parameters
from ros_3d_bb.nodes.bbox3d_node import Bbox3dNode
from ros_3d_bb.nodes.common.startup import Part, read_params
from ros_3d_bb.nodes.common.subscribers import AT_ONCE
from ros_3d_bb.nodes.depth_detector_node import DepthDetectorNode
from ros_3d_bb.nodes.tracker_node import TrackerNode
from ros_3d_bb.nodes.yolov5_node import Yolov5Node
from ros_3d_bb.pipeline.people_pipeline import check_equal


@parameters()
class PeopleNodeParams(NamedTuple):
    """Parameters of people_node, except those of the nodes in its process."""

    detector: str = Param('yolov5', choices=('yolov5', 'depth', 'none'))


class PeopleNode(object):
    """Detect, locate and track people in the images of one camera.

    The node consists of yolov5_node or depth_detector_node (~detector), bbox3d_node and tracker_node. Each image is
    received and decoded once, and results are passed on without a connection. Topics, parameters, services and
    diagnostics are those of these nodes and keep their names, for example bbox3d_node/stride. Inputs of the process are
    in the status of tracker_node.
    """

    def __init__(self):
        params, = read_params(PeopleNodeParams)
        tracker = TrackerNode(Part('tracker_node/', subscribes=False))
        # In a thread of its own, as the detector must not wait for the transforms of the tracker.
        worker = NewestWorker(lambda boxes: tracker.on_frame(*boxes),
                              lambda error: rospy.logerr('tracking failed: %s', error), AT_ONCE)
        rospy.on_shutdown(worker.stop)
        detector = inputs = None
        if params.detector == 'depth':
            detector = DepthDetectorNode(Part('depth_detector_node/', tracker.transforms, monitors=False))
            inputs = detector.inputs
        bbox3d = Bbox3dNode(Part('bbox3d_node/', tracker.transforms, inputs, lambda *boxes: worker.offer(boxes),
                                 subscribes=params.detector == 'none', monitors=False))
        if params.detector == 'depth':
            check_equal(detector.params, bbox3d.params)
        elif params.detector == 'yolov5':
            Yolov5Node(Part('yolov5_node/', tracker.transforms, next_stage=bbox3d.on_boxes, monitors=False))
