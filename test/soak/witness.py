"""Records the outputs of the graph and the diagnostics of its nodes."""
import functools
import time

import rospy
from diagnostic_msgs.msg import DiagnosticArray
from std_msgs.msg import Int32MultiArray
from visualization_msgs.msg import MarkerArray

from ros_3d_bb.conversions.perception_msgs import BOXES3D_TOPIC, BOXES_TOPIC, TRACKS_TOPIC
from ros_3d_bb.msg import BoundingBox3DArray, TrackedObjectArray
from ros_3d_bb.visualization.markers import MARKERS_TOPIC
from ros_3d_bb_lab.evaluation.latency.latency_probe_node import stamp_in, usage_of
from soak.invariants import BALANCES
from soak.records import Status, Track

KINDS = {BOXES_TOPIC: Int32MultiArray, BOXES3D_TOPIC: BoundingBox3DArray, TRACKS_TOPIC: TrackedObjectArray,
         MARKERS_TOPIC: MarkerArray}
MANY = 1000  # messages that may arrive at once without a loss


class Witness(object):
    """`arrivals`, `empty`, `tracks` and `statuses` of `records.Record`, of messages from other processes."""

    def __init__(self, graph):
        self.arrivals, self.tracks, self.statuses = {topic: [] for topic in KINDS}, [], []
        self.empty = {topic: 0 for topic in KINDS}
        self._graph = graph
        for topic, kind in KINDS.items():
            rospy.Subscriber(topic, kind, functools.partial(self._on_output, topic), queue_size=MANY)
        rospy.Subscriber('/diagnostics', DiagnosticArray, self._on_diagnostics, queue_size=MANY)

    def has_status_of(self, node, pid):
        """Whether a process of a node has published diagnostics."""
        return any((status.node, status.pid) == (node, pid) for status in reversed(self.statuses))

    def _on_output(self, topic, message):
        now_s = time.monotonic()
        if message._connection_header['callerid'] == rospy.get_name():
            return  # an invalid message of the camera
        stamp_ns = stamp_in(message)
        self.empty[topic] += not any(getattr(message, name, None) for name in ('data', 'boxes', 'objects', 'markers'))
        if stamp_ns is not None:
            self.arrivals[topic].append((now_s, stamp_ns))
        if topic == TRACKS_TOPIC:
            self.tracks.append((now_s, stamp_ns, [Track(track.id, track.first_seen.to_nsec(), track.last_seen.to_nsec())
                                                  for track in message.objects]))

    def _on_diagnostics(self, message):
        now_s = time.monotonic()
        for status in message.status:
            node = status.name.split(':')[0].lstrip('/')
            pid = self._graph.pids.get(node)
            used = usage_of(pid) if pid and node in BALANCES else None
            if used is not None:
                counts = {entry.key: int(entry.value) for entry in status.values if entry.value.isdigit()}
                self.statuses.append(Status(now_s, node, pid, counts, used[1]))
