"""ROS node that detects, locates and tracks people: the nodes of the pipeline in one process."""
import rospy

from ros_3d_bb.core.latest_worker import NewestWorker
from ros_3d_bb.nodes.bbox3d_node import Bbox3dNode
from ros_3d_bb.nodes.common.startup import Part, stored_params
from ros_3d_bb.nodes.common.subscribers import AT_ONCE
from ros_3d_bb.nodes.detector_node import DetectorNode
from ros_3d_bb.nodes.tracker_node import TrackerNode
from ros_3d_bb.pipeline.detectors import NONE
from ros_3d_bb.pipeline.people_pipeline import check_equal


class PeopleNode(object):
    """Detect, locate and track people in the images of one camera.

    The node consists of detector_node (unless its ~detector is none), bbox3d_node and tracker_node. Each image is
    received and decoded once, and results are passed on without a connection. Topics, parameters, services and
    diagnostics are those of these nodes and keep their names, for example bbox3d_node/stride. Inputs of the process are
    in the status of tracker_node.
    """

    def __init__(self):
        tracker = TrackerNode(Part('tracker_node/', subscribes=False))
        # In a thread of its own, as the detector must not wait for the transforms of the tracker.
        worker = NewestWorker(lambda boxes: tracker.on_frame(*boxes),
                              lambda error: rospy.logerr('tracking failed: %s', error), AT_ONCE)
        rospy.on_shutdown(worker.stop)
        detector = inputs = bbox3d = None
        if stored_params('detector_node').get('detector') != NONE:
            detector = DetectorNode(Part('detector_node/', tracker.transforms, monitors=False,
                                         next_stage=lambda *boxes: bbox3d and bbox3d.on_boxes(*boxes)))
            inputs = detector.inputs
        bbox3d = Bbox3dNode(Part('bbox3d_node/', tracker.transforms, inputs, lambda *boxes: worker.offer(boxes),
                                 subscribes=detector is None, monitors=False))
        if inputs is not None:
            check_equal(detector.params, bbox3d.params)
