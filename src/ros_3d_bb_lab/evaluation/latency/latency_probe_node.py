"""ROS node of the latency benchmark that records image stamps, arrival times of results, and resource usage of nodes.
"""
import functools
import json
import os
import time
from typing import NamedTuple
from xmlrpc.client import Fault, ServerProxy

import rospy
from sensor_msgs.msg import CameraInfo
from std_msgs.msg import Int32MultiArray
from visualization_msgs.msg import MarkerArray

from ros_3d_bb.conversions.perception_msgs import BOXES3D_TOPIC, BOXES_TOPIC, TRACKS_TOPIC, boxes2d_from_msg
from ros_3d_bb.core.params import Param, parameters
from ros_3d_bb.msg import BoundingBox3DArray, TrackedObjectArray
from ros_3d_bb.nodes.common.startup import read_params
from ros_3d_bb.nodes.common.subscribers import KEPT_AT_ONCE, subscribe
from ros_3d_bb_lab.evaluation.latency.latency_result import STAGES

START_TIMEOUT_S = 120.0  # includes the time for exporting the network of a detector
WARM_UP_S = 3.0  # from the first markers to the measurement
SAMPLE_S = 1.0
GRACE_S = 1.0  # waiting time for results of the last images
OUTPUTS = ((BOXES_TOPIC, Int32MultiArray), (BOXES3D_TOPIC, BoundingBox3DArray), (TRACKS_TOPIC, TrackedObjectArray),
           ('visualization_marker_array', MarkerArray))  # of `STAGES`


@parameters()
class LatencyProbeParams(NamedTuple):
    record: str = Param('')
    seconds: float = Param(20.0)


class LatencyProbeNode(object):
    """Record image stamps, arrival times of results, and the resource usage of each node for a period of time.

    Afterwards the node writes the record and exits. Parameters: see `LatencyProbeParams`; launch/latency.launch. Format
    of the record: see `ros_3d_bb_lab.evaluation.latency.latency_result.result_of`.
    """

    def __init__(self):
        self._params, = read_params(LatencyProbeParams)
        self._sent_ns, self._arrivals = [], {stage: [] for stage in STAGES}
        for stage, (topic, kind) in zip(STAGES, OUTPUTS):
            subscribe(topic, kind, functools.partial(self._on_answer, self._arrivals[stage]), KEPT_AT_ONCE)
        subscribe('camera/color/camera_info', CameraInfo,
                  lambda message: self._sent_ns.append(message.header.stamp.to_nsec()), KEPT_AT_ONCE)

    def _on_answer(self, arrivals, message):
        arrival_s, stamp_ns = time.time(), stamp_in(message)
        if stamp_ns is not None:
            arrivals.append((stamp_ns, arrival_s))

    def measure(self):
        """Wait for markers, measure, and write the record, unless the node is shut down before."""
        deadline_s = time.monotonic() + START_TIMEOUT_S
        while not self._arrivals['markers'] and not rospy.is_shutdown():
            if time.monotonic() > deadline_s:
                raise ValueError('no markers within %.0f s' % START_TIMEOUT_S)
            time.sleep(0.1)
        time.sleep(WARM_UP_S)
        if rospy.is_shutdown():
            return
        pids, began_s = pids_of_nodes(), time.time()
        usage = {node: [] for node in pids}
        while not rospy.is_shutdown():
            now_s = time.time()
            for node, pid in pids.items():
                used = usage_of(pid)
                if used is not None:
                    usage[node].append((now_s,) + used)
            if now_s >= began_s + self._params.seconds:
                break
            time.sleep(min(SAMPLE_S, began_s + self._params.seconds - now_s))
        else:
            return
        load = os.getloadavg()[0]
        time.sleep(GRACE_S)
        record = {'began_s': began_s, 'ended_s': now_s, 'sent_ns': self._sent_ns, 'arrivals': self._arrivals,
                  'usage': usage, 'load_average': load}
        with open(self._params.record, 'w') as stream:
            json.dump(record, stream)


def stamp_in(message):
    """Stamp of the image that a message belongs to, in integer nanoseconds; None for an empty MarkerArray."""
    if isinstance(message, MarkerArray):
        return message.markers[0].header.stamp.to_nsec() if message.markers else None
    if isinstance(message, Int32MultiArray):
        return boxes2d_from_msg(message).stamp_ns
    return message.header.stamp.to_nsec()


def pids_of_nodes():
    """Process IDs of all nodes of this master, {name of the node without leading slash: process ID}."""
    _code, _text, state = rospy.get_master().getSystemState()
    nodes = sorted(set(node for kind in state for _name, nodes in kind for node in nodes))
    return {node.lstrip('/'): pid_of(node) for node in nodes}


def pid_of(node):
    """Process ID of a node; None if it does not respond."""
    code, _status, uri = rospy.get_master().lookupNode(node)
    try:
        return ServerProxy(uri).getPid(rospy.get_name())[2] if code == 1 else None
    except (OSError, Fault):
        return None


def usage_of(pid):
    """CPU time of all threads of a process, seconds, and its resident memory, megabytes. None if it does not exist."""
    try:
        with open('/proc/%d/stat' % pid) as stream:
            fields = stream.read().rpartition(')')[2].split()  # the name may contain any character
    except (FileNotFoundError, ProcessLookupError):
        return None
    utime, stime, rss_pages = (int(fields[number - 3]) for number in (14, 15, 24))  # numbered as in proc(5)
    return (utime + stime) / os.sysconf('SC_CLK_TCK'), rss_pages * os.sysconf('SC_PAGE_SIZE') / 1e6
