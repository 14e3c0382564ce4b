"""ROS node that detects, locates and tracks people: the nodes of the pipeline in one process."""
import rospy

from ros_3d_bb.nodes.bbox3d_node import Bbox3dNode
from ros_3d_bb.nodes.common.diagnostics import Diagnostics
from ros_3d_bb.nodes.common.part import Part
from ros_3d_bb.nodes.common.startup import run_node
from ros_3d_bb.nodes.depth_detector_node import DepthDetectorNode
from ros_3d_bb.nodes.tracker_node import TrackerNode

NO_DETECTOR = 'none'


def _yolov5_node(part):
    from ros_3d_bb.nodes.yolov5_node import Yolov5Node  # which imports OpenCV or torch
    return Yolov5Node(part)


DETECTORS = {'yolov5': _yolov5_node, 'depth': DepthDetectorNode}


class PeopleNode(object):
    """Detect, locate and track people in the images of one camera.

    This is yolov5_node or depth_detector_node (~detector), bbox3d_node and tracker_node in one process. Each image is
    received and decoded once, and results are handed over without a connection. Topics, services and parameters have
    the names of these nodes (bbox3d_node/stride); the diagnostics are in one status. Only the tracks have a latency
    there.
    """

    def __init__(self):
        detector = rospy.get_param('~detector', 'yolov5')
        if detector != NO_DETECTOR and detector not in DETECTORS:
            raise ValueError('parameter ~detector is %r; %s or %s expected'
                             % (detector, ', '.join(sorted(DETECTORS)), NO_DETECTOR))
        part = Part(diagnostics=Diagnostics(), subscribes=False)
        tracker = TrackerNode(part._replace(namespace='tracker_node/'))
        part = part._replace(transforms=tracker.transforms)
        bbox3d = Bbox3dNode(part._replace(namespace='bbox3d_node/', next_stage=tracker.on_boxes,
                                          subscribes=detector == NO_DETECTOR))
        if detector != NO_DETECTOR:
            name = {'yolov5': 'yolov5_node/', 'depth': 'depth_detector_node/'}[detector]
            DETECTORS[detector](part._replace(namespace=name, next_stage=bbox3d.on_boxes))


def main():
    """Run the node."""
    run_node('people_node', PeopleNode)
