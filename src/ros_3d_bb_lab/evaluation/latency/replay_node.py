"""ROS node that plays the images of a bag from memory, as a simulated camera with minimal CPU usage."""
import itertools
import time
from typing import NamedTuple

import rospy
from std_msgs.msg import Int32MultiArray

from ros_3d_bb.bags.bag_writer import images_in
from ros_3d_bb.conversions.camera_msgs import TYPES
from ros_3d_bb.conversions.perception_msgs import BOXES_TOPIC, with_stamp
from ros_3d_bb.core.params import SET_BY_LAUNCH, Param, parameters
from ros_3d_bb.nodes.common.diagnostics import Diagnostics
from ros_3d_bb.nodes.common.startup import read_params


@parameters()
class ReplayParams(NamedTuple):
    bag: str = Param('')
    rate: float = Param(30.0, limits=(0.001, 1000))
    boxes: bool = Param(False, 'Whether the 2D boxes in the bag are published, too.', section=SET_BY_LAUNCH)


class ReplayNode(object):
    """Play the images of a bag forwards and backwards, which avoids jumps, with the time of publication as stamp.

    The bag must be from `scenario_to_bag`. Parameters: see `ReplayParams`; launch/latency.launch.
    """

    def __init__(self):
        self._params, = read_params(ReplayParams)
        types = dict(TYPES, **({BOXES_TOPIC: Int32MultiArray} if self._params.boxes else {}))
        self._images = images_in(self._params.bag, types)
        self._diagnostics = Diagnostics()
        self._pubs = {topic: rospy.Publisher('/tf' if topic == 'tf' else topic, kind, queue_size=10)
                      for topic, kind in types.items()}

    def run(self):
        """Publish at the configured rate. Images that are late by more than a period are skipped."""
        period_s, due_s = 1.0 / self._params.rate, time.monotonic()
        for messages in itertools.cycle(self._images + self._images[-2:0:-1]):
            due_s += period_s
            late_s = time.monotonic() - due_s
            if late_s > period_s:
                self._diagnostics.count('images skipped')
                continue
            time.sleep(max(0.0, -late_s))
            if rospy.is_shutdown():
                return
            stamp = rospy.get_rostime()
            with self._diagnostics.rejecting('images'):
                for topic, message in messages:
                    self._pubs[topic].publish(with_stamp(message, stamp))
                self._diagnostics.count('images')
                self._diagnostics.record_latency(stamp)
