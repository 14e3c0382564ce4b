"""Wrong messages through the callbacks of real nodes, and good ones after them."""
import contextlib
import time
import warnings
from typing import Callable, NamedTuple
from unittest import mock

import numpy as np
from geometry_msgs.msg import TransformStamped
from tf2_msgs.msg import TFMessage

from fuzz import hostile
from ros_3d_bb.conversions.camera_msgs import COLOR_TOPIC, DEPTH_TOPIC, INFO_TOPICS
from ros_3d_bb.conversions.perception_msgs import BOXES3D_TOPIC, BOXES_TOPIC, TRACKS_TOPIC, time_from
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.msg import TrackedObjectArray
from ros_3d_bb.nodes.bbox3d_node import Bbox3dNode
from ros_3d_bb.nodes.depth_detector_node import DepthDetectorNode
from ros_3d_bb.nodes.planner_bridge_node import PlannerBridgeNode
from ros_3d_bb.nodes.tracker_node import TrackerNode
from ros_3d_bb.nodes.viewer_node import ViewerNode
from ros_3d_bb.nodes.yolov5_node import Yolov5Node
from soak.invariants import BALANCES, WAITING, balance_of
from soak.records import Status
from support.masterless import masterless, on_the_wire

INFO_TOPIC = INFO_TOPICS[0]
START_NS, PERIOD_NS = 1000 * NS, NS // 30
EVERY = 200  # rounds after which good messages have to work


class Target(NamedTuple):
    """A node: how to make it, its parameters, and the topic on which good messages have to bring something; `outputs`
    counts what came of them where it is not published.
    """

    make: Callable
    params: dict
    output: str


class Network(object):
    """Stands in for a network: its predictions are as wrong as can be."""

    names, stride, input_hw, description = ('person', 'chair'), 32, None, 'noise'

    def __init__(self, source):
        self._source = source

    def __call__(self, _image, least):
        if self._source is None:
            return np.zeros((0, 7), np.float32)
        rows = np.array([[self._source.number() for _column in range(7)] for _row in range(5)])
        with np.errstate(over='ignore', invalid='ignore'):
            rows = rows.astype(np.float32)
            return rows[rows[:, 4] > least]


def _yolov5(source):
    with mock.patch('ros_3d_bb.pipeline.detection_stage.open_runtime', lambda *_given: Network(source)):
        return Yolov5Node()


TARGETS = {
    'bbox3d_node': Target(lambda _source: Bbox3dNode(), {}, 'ros_3d_bb/bb_3d'),
    'tracker_node': Target(lambda _source: TrackerNode(), {'tf_timeout': 0.0}, TRACKS_TOPIC),
    'yolov5_node': Target(_yolov5, {'weights': 'noise.pt', 'image_size': 64}, BOXES_TOPIC),
    'depth_detector_node': Target(lambda _source: DepthDetectorNode(), {}, BOXES_TOPIC),
    'planner_bridge_node': Target(lambda _source: PlannerBridgeNode(), {'tf_timeout': 0.0}, '~points'),
    'viewer_node': Target(lambda _source: ViewerNode(), {'window': False}, '')}


def fuzz_node(name, seed, count, deadline_s=float('inf')):
    """Send a node so many wrong messages, or as many as it takes until a time on time.monotonic().

    Returns
    -------
    int, float
        How many were sent; CPU seconds.

    Raises
    ------
    Exception
        What a callback raised.
    AssertionError
        If good messages did not work after wrong ones, or a message has no outcome in the node's counts.
    """
    source, target, sent, began_s = hostile.Source(seed), TARGETS[name], 0, time.process_time()
    with masterless(target.params) as connections, _quiet():
        node = target.make(source)
        now_ns = START_NS
        while sent < count and time.monotonic() < deadline_s:
            for _round in range(EVERY):
                now_ns += PERIOD_NS
                connections.now = time_from(now_ns)
                if source.random() < 0.9:
                    _send_transforms(connections, now_ns)
                elif source.random() < 0.3:
                    _send_transforms(connections, source.choice((2 ** 31, 2 ** 32 - 1)) * NS)
                messages = _round_of(source, now_ns, connections)
                for topic, message in messages:
                    try:
                        connections.send(topic, on_the_wire(message))
                    except Exception:
                        print('%s, seed %d: after %d messages, on %s' % (name, seed, sent, topic))
                        raise
                    sent += 1
                for timer in connections.timers:
                    timer(None)
            now_ns = _check_good(name, target, node, connections, now_ns)
            _check_outcomes(name, node)
    return sent, time.process_time() - began_s


@contextlib.contextmanager
def _quiet():
    """numpy's warnings of nan and inf are no faults here."""
    with np.errstate(all='ignore'), warnings.catch_warnings():
        warnings.simplefilter('ignore')
        yield


def _round_of(source, now_ns, connections):
    """What comes of one image, in any order, wrong or not."""
    good = hostile.good_frame(now_ns)
    good[BOXES_TOPIC] = hostile.good_boxes(now_ns)
    made = {INFO_TOPIC: lambda: hostile.camera_info(source, now_ns, good[INFO_TOPIC]),
            DEPTH_TOPIC: lambda: hostile.image(source, now_ns, good[DEPTH_TOPIC]),
            COLOR_TOPIC: lambda: hostile.image(source, now_ns, good[COLOR_TOPIC]),
            BOXES_TOPIC: lambda: hostile.boxes2d(source, now_ns),
            BOXES3D_TOPIC: lambda: hostile.boxes3d(source, now_ns),
            TRACKS_TOPIC: lambda: hostile.tracks(source, now_ns)}
    topics = [topic for topic in sorted(connections.subscribers) if topic in made]
    source.shuffle(topics)
    return [(topic, good[topic] if topic in good and source.random() < 0.4 else made[topic]()) for topic in topics]


def _send_transforms(connections, now_ns):
    message = TFMessage()
    for parent, child in (('map', 'base_link'), ('base_link', 'camera')):
        transform = TransformStamped(child_frame_id=child)
        transform.header.frame_id, transform.header.stamp = parent, time_from(now_ns)
        turn = transform.transform.rotation
        turn.x, turn.y, turn.z, turn.w = (-0.5, 0.5, -0.5, 0.5) if child == 'camera' else (0.0, 0.0, 0.0, 1.0)
        message.transforms.append(transform)
    if '/tf' in connections.subscribers:
        connections.send('/tf', on_the_wire(message))


def _check_good(name, target, node, connections, now_ns):
    """Good messages, a second and more later, have to work. Returns their stamp."""
    before = connections.publishers[target.output].count if target.output else 0
    for buffer in connections.buffers:
        buffer.clear()
    for step in range(6):
        now_ns += 2 * NS if not step else PERIOD_NS
        connections.now = time_from(now_ns)
        _send_transforms(connections, now_ns)
        good = hostile.good_frame(now_ns)
        good[BOXES_TOPIC] = hostile.good_boxes(now_ns)
        boxes = hostile.boxes3d(hostile.Source(0), now_ns)
        boxes.header.frame_id, boxes.header.stamp, boxes.boxes = 'camera', time_from(now_ns), []
        good[BOXES3D_TOPIC] = boxes
        good[TRACKS_TOPIC] = TrackedObjectArray(header=boxes.header)
        for topic in (INFO_TOPIC, DEPTH_TOPIC, COLOR_TOPIC, BOXES_TOPIC, BOXES3D_TOPIC, TRACKS_TOPIC):
            if topic in connections.subscribers:
                connections.send(topic, on_the_wire(good[topic]))
    if target.output:
        came = connections.publishers[target.output]
        assert came.count > before, '%s: good messages bring nothing after wrong ones' % name
        if hasattr(came.newest, 'header'):
            assert came.newest.header.stamp == time_from(now_ns), '%s: stamped %s' % (name, came.newest.header.stamp)
    elif name == 'viewer_node':
        newest = node._snapshots.newest
        assert newest is not None and newest.stamp_ns == now_ns, '%s shows an image of the time before' % name
    return now_ns


def _check_outcomes(name, node):
    if name in BALANCES:
        found = balance_of(Status(0.0, name, 0, dict(node._diagnostics.counters()), 0.0, 0.0))
        assert 0 <= found[3] <= WAITING, '%s: %d inputs, %d published, %d not for a reason, %d without outcome' % (
            (name,) + found)
