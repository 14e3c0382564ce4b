"""ROS node that detects, locates and tracks people: the nodes of the pipeline in one process."""
from typing import NamedTuple

from ros_3d_bb.core.params import Param, parameters
from ros_3d_bb.nodes.bbox3d_node import Bbox3dNode
from ros_3d_bb.nodes.common.diagnostics import Diagnostics
from ros_3d_bb.nodes.common.part import Part
from ros_3d_bb.nodes.common.startup import read_params, run_node
from ros_3d_bb.nodes.depth_detector_node import DepthDetectorNode
from ros_3d_bb.nodes.tracker_node import TrackerNode

from ros_3d_bb.nodes.yolov5_node import Yolov5Node

DETECTORS = {'yolov5': ('yolov5_node/', Yolov5Node), 'depth': ('depth_detector_node/', DepthDetectorNode)}


@parameters()
class PeopleNodeParams(NamedTuple):
    """Parameters of people_node, except those of the nodes in its process."""

    detector: str = Param('yolov5', choices=('yolov5', 'depth', 'none'))


class PeopleNode(object):
    """Detect, locate and track people in the images of one camera.

    The node consists of yolov5_node or depth_detector_node (~detector), bbox3d_node and tracker_node. Each image is
    received and decoded once, and results are passed on without a connection. The topics are those of these nodes.
    Parameters and services keep their names, for example bbox3d_node/stride. Their diagnostics are in one status, with
    the latency of the tracks.
    """

    def __init__(self):
        params, = read_params(PeopleNodeParams)
        part = Part(diagnostics=Diagnostics(), subscribes=False)
        tracker = TrackerNode(part._replace(namespace='tracker_node/'))
        part = part._replace(transforms=tracker.transforms)
        bbox3d = Bbox3dNode(part._replace(namespace='bbox3d_node/', next_stage=tracker.on_boxes,
                                          subscribes=params.detector not in DETECTORS))
        if params.detector in DETECTORS:
            namespace, node = DETECTORS[params.detector]
            node(part._replace(namespace=namespace, next_stage=bbox3d.on_boxes))


def main():
    """Run the node."""
    run_node('people_node', PeopleNode)
