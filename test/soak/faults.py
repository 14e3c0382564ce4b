"""What goes wrong on robots. Each is a context manager: the block is the time of the fault; it yields its name."""
import contextlib
import copy
import os
import signal
import subprocess
import sys

import numpy as np
from geometry_msgs.msg import TransformStamped
from tf2_msgs.msg import TFMessage

from fuzz import hostile
from ros_3d_bb.conversions.camera_msgs import COLOR_TOPIC, DEPTH_TOPIC, INFO_TOPICS, TF_TOPIC
from ros_3d_bb.conversions.image_msgs import array_from, fill_image
from ros_3d_bb.conversions.perception_msgs import BOXES3D_TOPIC, BOXES_TOPIC, TRACKS_TOPIC, time_from
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
    """The cause ends when the node that was started in its place speaks."""
    node = rig.source.choice(sorted(rig.graph.pids))
    pid = rig.graph.pids[node]
    rig.killed.add(pid)
    os.kill(pid, signal.SIGKILL)
    yield '%s killed' % node
    rig.wait_until(lambda: _speaks(rig, node, pid), '%s to be back' % node)


def _speaks(rig, node, pid_before):
    newest = rig.witness.newest_status(node)
    return rig.graph.pids[node] != pid_before and newest is not None and newest.pid == rig.graph.pids[node]


@contextlib.contextmanager
def node_hangs(rig):
    """Mostly the detector."""
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
def camera_pauses(rig):
    """While time goes on."""
    rig.camera.sends = False
    try:
        yield 'camera pauses'
    finally:
        rig.camera.sends = True


@contextlib.contextmanager
def bag_pauses(rig):
    """Time stands still."""
    rig.camera.tells_time = False
    try:
        yield 'bag pauses'
    finally:
        rig.camera.tells_time = True


@contextlib.contextmanager
def topic_stops(rig):
    """tf, or the depth images alone."""
    topic, name = rig.source.choice(((TF_TOPIC, 'tf stops'), (TF_TOPIC, 'tf stops'), (DEPTH_TOPIC, 'no depth images'),
                                     (INFO_TOPICS[0], 'no camera_info')))
    rig.camera.missing = {topic}
    try:
        yield name
    finally:
        rig.camera.missing = set()


@contextlib.contextmanager
def bag_loops(rig):
    """Time goes back, far or little."""
    rig.camera.jump(-rig.source.choice((2.0, 10.0, 60.0)))
    yield 'time jumps back'


@contextlib.contextmanager
def bag_seeks(rig):
    """Time goes on later."""
    rig.camera.jump(rig.source.choice((2.0, 30.0, 3600.0)))
    yield 'time jumps ahead'


@contextlib.contextmanager
def wrong_messages(rig):
    """Beside the good ones, on all topics."""
    rig.camera.throw_in = lambda stamp_ns, good: _wrong(rig.wrong_source, stamp_ns, good)
    try:
        yield 'wrong messages'
    finally:
        rig.camera.throw_in = None


def _wrong(source, stamp_ns, good):
    """[(topic, stamp, message), ...] of one image."""
    make = {INFO_TOPICS[0]: lambda: hostile.camera_info(source, stamp_ns, good[INFO_TOPICS[0]]),
            DEPTH_TOPIC: lambda: hostile.image(source, stamp_ns, good[DEPTH_TOPIC]),
            COLOR_TOPIC: lambda: hostile.image(source, stamp_ns, good[COLOR_TOPIC]),
            BOXES_TOPIC: lambda: hostile.boxes2d(source, stamp_ns),
            BOXES3D_TOPIC: lambda: hostile.boxes3d(source, stamp_ns),
            TRACKS_TOPIC: lambda: hostile.tracks(source, stamp_ns),
            TF_TOPIC: lambda: _late_transform(source)}
    topics = [source.choice(sorted(make)) for _message in range(source.choice((1, 2, 4)))]
    return [(topic, _stamp(message), message) for topic, message in ((topic, make[topic]()) for topic in topics)]


def _stamp(message):
    """Its stamp; 0 where it has none that one could read."""
    if isinstance(message, TFMessage):
        return 0
    try:
        return stamp_in(message) or 0
    except ValueError:
        return 0


def _late_transform(source):
    """Of a time that tf2 cannot reckon with."""
    transform = TransformStamped(child_frame_id='odom')
    transform.header.frame_id, transform.header.stamp = 'map', time_from(source.choice((2 ** 31, 2 ** 32 - 1)) * NS)
    transform.transform.rotation.w = 1.0
    return TFMessage([transform])


@contextlib.contextmanager
def camera_changes(rig):
    """Its camera_info: uncalibrated, of another size, not a number; or smaller depth images than it says."""
    name, change = rig.source.choice((('camera_info without focal length', _uncalibrated),
                                      ('camera_info of another size', _halved), ('camera_info not a number', _nan),
                                      ('depth not aligned', _smaller_depth)))
    rig.camera.change = change
    try:
        yield name
    finally:
        rig.camera.change = None


def _uncalibrated(topic, message):
    return _changed(message, K=[0.0] * 9) if topic in INFO_TOPICS else message


def _halved(topic, message):
    return _changed(message, width=message.width // 2, height=message.height // 2) if topic in INFO_TOPICS else message


def _nan(topic, message):
    return _changed(message, K=[float('nan')] + list(message.K[1:])) if topic in INFO_TOPICS else message


def _smaller_depth(topic, message):
    if topic != DEPTH_TOPIC:
        return message
    return fill_image(copy.copy(message), np.ascontiguousarray(array_from(message)[::2, ::2]), message.encoding)


def _changed(message, **fields):
    message = copy.copy(message)
    for name, value in fields.items():
        setattr(message, name, value)
    return message


@contextlib.contextmanager
def subscriber_never_reads(rig):
    """A process that connects to all outputs, and then stops."""
    process = subprocess.Popen([sys.executable, '-c', NEVER_READS] + ['/' + topic for topic in ALL_OUTPUTS])
    try:
        rig.wait_until(lambda: process.poll() is not None or _is_stopped(process.pid), 'a subscriber to stop')
        yield 'a subscriber never reads' if process.poll() is None else 'a subscriber did not start'
    finally:
        process.kill()
        process.wait()


def _is_stopped(pid):
    with open('/proc/%d/stat' % pid) as stream:
        return stream.read().rpartition(')')[2].split()[0] == 'T'


@contextlib.contextmanager
def cpu_is_taken(_rig):
    """Two processes that compute."""
    with cpu_load(2):
        yield 'CPU taken'


# (fault, whether it lasts, whether stamps may go back)
FAULTS = ((node_killed, False, True), (node_hangs, True, False), (camera_pauses, True, False),
          (bag_pauses, True, False), (topic_stops, True, False), (bag_loops, False, True), (bag_seeks, False, False),
          (wrong_messages, True, True), (camera_changes, True, False), (subscriber_never_reads, True, False),
          (cpu_is_taken, True, False))
