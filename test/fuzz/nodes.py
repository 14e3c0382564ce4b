"""Invalid messages to the callbacks of real nodes, followed by valid ones."""
import contextlib
import time
import warnings
from typing import Callable, NamedTuple
from unittest import mock

import numpy as np

from fuzz import hostile
from ros_3d_bb.conversions.perception_msgs import BOXES_TOPIC, TRACKS_TOPIC, time_from
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.detection.yolov5.predictions import Backend
from ros_3d_bb.nodes.bbox3d_node import Bbox3dNode
from ros_3d_bb.nodes.camera_pose_node import CameraPoseNode
from ros_3d_bb.nodes.depth_detector_node import DepthDetectorNode
from ros_3d_bb.nodes.follow_node import FollowNode
from ros_3d_bb.nodes.people_removal_node import PeopleRemovalNode
from ros_3d_bb.nodes.planner_bridge_node import PlannerBridgeNode
from ros_3d_bb.nodes.speed_limit_node import SpeedLimitNode
from ros_3d_bb.nodes.tracker_node import TrackerNode
from ros_3d_bb.nodes.viewer_node import ViewerNode
from ros_3d_bb.nodes.yolov5_node import Yolov5Node
from support.masterless import masterless, on_the_wire

START_NS, PERIOD_NS = 1000 * NS, NS // 30
EVERY = 200  # images between checks with valid messages


class Target(NamedTuple):
    """A node under test."""

    make: Callable  # of a Source; returns the node
    params: dict
    output: str     # topic on which it responds to valid messages, if there is one


class Network(Backend):
    """Replaces a network by invalid predictions."""

    names, stride, description = ('person', 'chair'), 32, 'noise'

    def __init__(self, source):
        self._source = source

    def __call__(self, _image, least):
        if self._source is None:
            return np.zeros((0, 7), np.float32)
        rows = np.array([self._source.number() for _number in range(35)]).reshape(5, 7)
        with np.errstate(over='ignore', invalid='ignore'):
            rows = rows.astype(np.float32)
            return rows[rows[:, 4] > least]


def _yolov5(source):
    with mock.patch('ros_3d_bb.detection.yolov5.backends.open_runtime', lambda *_given: Network(source)):
        return Yolov5Node()


TARGETS = {
    'bbox3d_node': Target(lambda _source: Bbox3dNode(), {}, 'ros_3d_bb/bb_3d'),
    'tracker_node': Target(lambda _source: TrackerNode(), {'tf_timeout': 0.0}, TRACKS_TOPIC),
    'yolov5_node': Target(_yolov5, {'weights': 'noise.pt', 'image_size': 64}, BOXES_TOPIC),
    'depth_detector_node': Target(lambda _source: DepthDetectorNode(), {}, BOXES_TOPIC),
    'camera_pose_node': Target(lambda _source: CameraPoseNode(), {}, ''),
    'people_removal_node': Target(lambda _source: PeopleRemovalNode(),
                                  {'inputs': 'scan, points, depth', 'tf_timeout': 0.0}, '~scan_static'),
    'planner_bridge_node': Target(lambda _source: PlannerBridgeNode(), {'tf_timeout': 0.0}, '~points'),
    'follow_node': Target(lambda _source: FollowNode(), {'enabled': True}, ''),
    'speed_limit_node': Target(lambda _source: SpeedLimitNode(), {}, 'cmd_vel'),
    'viewer_node': Target(lambda _source: ViewerNode(), {'window': False}, '')}


def fuzz_node(name, seed, count):
    """Send this number of messages, or more, to a node, many of them invalid.

    Returns the number of messages and the CPU time in seconds. Raises what a callback raised, and AssertionError if
    valid messages do not work afterwards.
    """
    source, target, sent, began_s = hostile.Source(seed), TARGETS[name], 0, time.process_time()
    with masterless(target.params) as connections, _quiet():
        node = target.make(source)
        now_ns = START_NS
        while sent < count:
            for _round in range(EVERY):
                now_ns += PERIOD_NS
                connections.now = time_from(now_ns)
                if source.random() < 0.9:
                    _send_transforms(connections, now_ns)
                elif source.random() < 0.3:
                    _send_transforms(connections, source.choice((2 ** 31, 2 ** 32 - 1)) * NS)
                for topic, message in _messages_of(source, now_ns, connections):
                    try:
                        connections.send(topic, on_the_wire(message))
                    except Exception:
                        print('%s, seed %d: after %d messages, on %s' % (name, seed, sent, topic))
                        raise
                    sent += 1
                for _period_s, timer in connections.timers:
                    timer(None)
            now_ns = _check_valid(name, node, connections, now_ns)
    return sent, time.process_time() - began_s


@contextlib.contextmanager
def _quiet():
    """Warnings about NaN and infinity are not errors here."""
    with np.errstate(all='ignore'), warnings.catch_warnings():
        warnings.simplefilter('ignore')
        yield


def _messages_of(source, now_ns, connections):
    """Messages of one image, valid or not, in random order."""
    good = hostile.good_messages(now_ns)
    topics = [topic for topic in sorted(connections.subscribers) if topic in good]
    source.shuffle(topics)
    return [(topic, good[topic] if source.random() < 0.4 else hostile.damaged(source, good[topic], now_ns))
            for topic in topics]


def _send_transforms(connections, stamp_ns):
    if '/tf' in connections.subscribers:
        connections.send('/tf', on_the_wire(hostile.transforms(stamp_ns)))


def send_image(connections, stamp_ns, messages=None):
    """At the time of a stamp, send transforms and the messages of an image (by default valid ones) to subscribers."""
    connections.now = time_from(stamp_ns)
    _send_transforms(connections, stamp_ns)
    for topic, message in (messages or hostile.good_messages(stamp_ns)).items():
        if topic in connections.subscribers:
            connections.send(topic, on_the_wire(message))


def _check_valid(name, node, connections, now_ns):
    """Check that valid messages, more than a second later, are processed. Returns their stamp."""
    output = TARGETS[name].output
    before = connections.publishers[output].count if output else 0
    for buffer in connections.buffers:
        buffer.clear()
    for step in range(6):
        now_ns += PERIOD_NS if step else 2 * NS
        send_image(connections, now_ns)
    if output:
        publisher = connections.publishers[output]
        assert publisher.count > before, '%s: no output for valid messages after invalid ones' % name
        if hasattr(publisher.newest, 'header'):
            assert publisher.newest.header.stamp == time_from(now_ns), '%s: old stamp' % name
    elif name == 'viewer_node':
        assert node._snapshots.newest.stamp_ns == now_ns, '%s shows an old image' % name
    return now_ns
