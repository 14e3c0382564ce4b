"""Faults. Each is a context manager, which yields the name of the fault and lasts while its cause exists."""
import contextlib
import copy
import functools
import os
import signal
import subprocess
import sys

import numpy as np

from fuzz import hostile
from ros_3d_bb.conversions.camera_msgs import COLOR_TOPIC, DEPTH_TOPIC, INFO_TOPICS, TF_TOPIC
from ros_3d_bb.conversions.image_msgs import array_from, fill_image
from ros_3d_bb.conversions.perception_msgs import BOXES3D_TOPIC, BOXES_TOPIC, TRACKS_TOPIC
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb_lab.evaluation.latency.benchmark import cpu_load
from ros_3d_bb_lab.evaluation.latency.latency_probe_node import stamp_in

DETECTORS = ('depth_detector_node', 'yolov5_node')
NEVER_READS = '''
import os, signal, sys, time
import rospy
rospy.init_node('never_reads', anonymous=True, disable_signals=True)
for topic in sys.argv[1:]:
    rospy.Subscriber(topic, rospy.AnyMsg, lambda message: None)
time.sleep(1.5)
os.kill(os.getpid(), signal.SIGSTOP)
'''
ALL_OUTPUTS = (BOXES_TOPIC, BOXES3D_TOPIC, TRACKS_TOPIC, 'visualization_marker_array', 'yolo_result_out',
               'ros_3d_bb/raw', 'ros_3d_bb/color', 'ros_3d_bb/depth', 'planner_bridge_node/points', COLOR_TOPIC,
               DEPTH_TOPIC)


@contextlib.contextmanager
def node_killed(rig):
    """The cause ends when the respawned node publishes diagnostics."""
    node = rig.source.choice(sorted(rig.graph.pids))
    pid = rig.graph.pids[node]
    rig.killed.add(pid)
    os.kill(pid, signal.SIGKILL)
    yield '%s killed' % node
    rig.wait_until(lambda: rig.graph.pids[node] != pid and rig.witness.has_status_of(node, rig.graph.pids[node]),
                   'respawned %s' % node)


@contextlib.contextmanager
def node_hangs(rig):
    """In half of the cases it is the detector."""
    nodes = sorted(rig.graph.pids)
    detectors = [node for node in nodes if node in DETECTORS]
    node = rig.source.choice(detectors if detectors and rig.source.random() < 0.5 else nodes)
    pid = rig.graph.pids[node]
    os.kill(pid, signal.SIGSTOP)
    try:
        yield '%s hangs' % node
    finally:
        os.kill(pid, signal.SIGCONT)


@contextlib.contextmanager
def _camera_with(rig, name, attribute, value):
    """An attribute of the camera has another value."""
    before = getattr(rig.camera, attribute)
    setattr(rig.camera, attribute, value)
    try:
        yield name
    finally:
        setattr(rig.camera, attribute, before)


def camera_pauses(rig):
    """Time continues."""
    return _camera_with(rig, 'camera pauses', 'sends', False)


def bag_pauses(rig):
    """Time stands still."""
    return _camera_with(rig, 'bag pauses', 'publishes_clock', False)


def topic_stops(rig):
    """Either tf, or the depth images alone, or camera_info."""
    topic, name = rig.source.choice(((TF_TOPIC, 'tf stops'), (TF_TOPIC, 'tf stops'), (DEPTH_TOPIC, 'no depth images'),
                                     (INFO_TOPICS[0], 'no camera_info')))
    return _camera_with(rig, name, 'missing', {topic})


def camera_changes(rig):
    """camera_info without focal length, of another size, or not a number; or depth that does not match it."""
    name, change = rig.source.choice((
        ('camera_info without focal length', functools.partial(_change_info, lambda info: {'K': [0.0] * 9})),
        ('camera_info of another size', functools.partial(
            _change_info, lambda info: {'width': info.width // 2, 'height': info.height // 2})),
        ('camera_info not a number', functools.partial(
            _change_info, lambda info: {'K': [float('nan')] + list(info.K[1:])})),
        ('depth not aligned', _shrink_depth)))
    return _camera_with(rig, name, 'change', change)


def _change_info(fields_of, topic, message):
    if topic not in INFO_TOPICS:
        return message
    changed = copy.copy(message)
    for name, value in fields_of(message).items():
        setattr(changed, name, value)
    return changed


def _shrink_depth(topic, message):
    if topic != DEPTH_TOPIC:
        return message
    return fill_image(copy.copy(message), np.ascontiguousarray(array_from(message)[::2, ::2]), message.encoding)


@contextlib.contextmanager
def time_jumps_back(rig):
    """As in a bag that loops."""
    rig.camera.jump(-rig.source.choice((2.0, 10.0, 60.0)))
    yield 'time jumps back'


@contextlib.contextmanager
def time_jumps_ahead(rig):
    """As in a bag when the user seeks."""
    rig.camera.jump(rig.source.choice((2.0, 30.0, 3600.0)))
    yield 'time jumps ahead'


def wrong_messages(rig):
    """Beside the valid ones, on all topics."""
    return _camera_with(rig, 'wrong messages', 'throw_in', functools.partial(_wrong_messages_of, rig.wrong_source))


def _wrong_messages_of(source, stamp_ns, good):
    """[(topic, stamp, message), ...] that accompany an image."""
    make = hostile.makers(source, stamp_ns, good)
    make[TF_TOPIC] = lambda: hostile.transforms(source.choice((2 ** 31, 2 ** 32 - 1)) * NS)  # invalid for tf2
    topics = [source.choice(sorted(make)) for _message in range(source.choice((1, 2, 4)))]
    return [(topic, _stamp_of(message), message) for topic, message in ((topic, make[topic]()) for topic in topics)]


def _stamp_of(message):
    """Stamp of a message; 0 if it has none or an unreadable one."""
    try:
        return stamp_in(message) or 0
    except (AttributeError, ValueError):
        return 0


@contextlib.contextmanager
def subscriber_never_reads(rig):
    """A process that subscribes to all outputs, and then stops."""
    process = subprocess.Popen([sys.executable, '-c', NEVER_READS] + ['/' + topic for topic in ALL_OUTPUTS])
    try:
        rig.wait_until(lambda: process.poll() is not None or _is_stopped(process.pid), 'stopped subscriber')
        yield 'a subscriber never reads' if process.poll() is None else 'a subscriber did not start'
    finally:
        process.kill()
        process.wait()


def _is_stopped(pid):
    with open('/proc/%d/stat' % pid) as stream:
        return stream.read().rpartition(')')[2].split()[0] == 'T'


@contextlib.contextmanager
def cpu_is_loaded(_rig):
    """By two processes."""
    with cpu_load(2):
        yield 'CPU loaded'


# (fault, whether it lasts, whether stamps may decrease)
FAULTS = ((node_killed, False, True), (node_hangs, True, False), (camera_pauses, True, False),
          (bag_pauses, True, False), (topic_stops, True, False), (time_jumps_back, False, True),
          (time_jumps_ahead, False, False), (wrong_messages, True, True), (camera_changes, True, False),
          (subscriber_never_reads, True, False), (cpu_is_loaded, True, False))
