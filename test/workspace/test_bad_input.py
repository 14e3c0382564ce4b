"""An invalid message is rejected with a reason or used in part, and the next valid one is processed at once.

Real nodes, without a master. test/fuzz mixes more faults at random; test_perception_msgs.py and test_image_msgs.py list
the reasons.
"""
import contextlib
from unittest import mock

import genpy
import pytest
from sensor_msgs.msg import CompressedImage
from std_msgs.msg import Header

from fuzz import hostile
from fuzz.nodes import TARGETS, _quiet, send_image
from ros_3d_bb.conversions.camera_msgs import COLOR_TOPIC, DEPTH_TOPIC, INFO_TOPICS
from ros_3d_bb.conversions.perception_msgs import BOXES3D_TOPIC, BOXES_TOPIC, boxes2d_from_msg, time_from
from ros_3d_bb.core.time_sync import NS
from support.masterless import masterless

INFO_TOPIC = INFO_TOPICS[0]
START_NS, PERIOD_NS = 1000 * NS, NS // 30
HOUR_NS = 3600 * NS


def fields(**values):
    """A change of fields, `a`, or `a__b` and `a__0` for parts of a field."""
    def change(message):
        for name, value in values.items():
            part, parts = message, name.split('__')
            for inner in parts[:-1]:
                part = part[int(inner)] if inner.isdigit() else getattr(part, inner)
            if parts[-1].isdigit():
                part[int(parts[-1])] = value
            else:
                setattr(part, parts[-1], value)
    return change


def label(text):
    return fields(layout__dim__0__label=text)


def stamped(stamp_ns):
    """A change of the stamp of this message alone; the messages of one image share their header."""
    return fields(header=Header(stamp=time_from(stamp_ns), frame_id='camera'))


def damaged_compressed(message):
    """A compressed image in place of the message."""
    return CompressedImage(message.header, '16UC1; compressedDepth', bytes(100))


OTHER_STAMPS = [(stamped(START_NS + HOUR_NS), None), (stamped(START_NS - 900 * NS), None)]
IMAGES = OTHER_STAMPS + [
    (fields(step=1), 'image data is too short'),
    (damaged_compressed, "sensor_msgs/CompressedImage of format '16UC1; compressedDepth' cannot be decoded"),
    (fields(header__stamp=genpy.Time()), 'has no stamp (zero)'),
    (fields(header__stamp=time_from(START_NS + HOUR_NS)), None),
    (fields(header__stamp=time_from(START_NS - 900 * NS)), None)]
CAMERAS = OTHER_STAMPS + [(fields(K=[0.0] * 9), 'it is empty'), (stamped(0), None)]
BOXES2D = [
    (fields(data=[26, 8, 38]), '3 numbers; a multiple of 4 expected'),
    (fields(data=[38, 44, 26, 8]), '(38, 44, 26, 8) is empty or reversed'),
    (fields(data=[-2 ** 31, -2 ** 31, 2 ** 31 - 1, 2 ** 31 - 1]), None),
    (label('boxes;stamp=0.000000000;frame=camera'), 'no depth image with their stamp 0.000'),
    (label('boxes;stamp=4600.000000000;frame=camera'), None)]  # they wait for their image, for ~cache_length
BOXES3D = [
    (fields(boxes__0__center__position__z=float('nan')), 'has centre (0, 0, nan)'),
    (fields(header__stamp=genpy.Time()), 'has no stamp (zero)'),
    (fields(header__stamp=time_from(START_NS + HOUR_NS)), 'no transform from camera to map at 4600.000'),
    (fields(header__stamp=time_from(START_NS - 900 * NS)), 'no transform from camera to map at 100.000'),
    (fields(header__frame_id='nowhere'), 'no transform from nowhere')]
RGBD_NODES = 'bbox3d_node', 'depth_detector_node', 'tracker_node', 'viewer_node'
INPUTS = [('bbox3d_node', BOXES_TOPIC, BOXES2D), ('tracker_node', BOXES3D_TOPIC, BOXES3D),
          ('viewer_node', BOXES3D_TOPIC, OTHER_STAMPS + BOXES3D[:1]),
          ('bbox3d_node', INFO_TOPIC, [(fields(width=32, height=24), 'aligned'), (fields(K__0=90.0), None)]),
          ('depth_detector_node', INFO_TOPIC, [(fields(width=32, height=24), 'aligned')])]
INPUTS += [(node, DEPTH_TOPIC, IMAGES) for node in RGBD_NODES]
INPUTS += [(node, INFO_TOPIC, CAMERAS) for node in RGBD_NODES]
INPUTS += [(node, COLOR_TOPIC, IMAGES) for node in ('yolov5_node', 'depth_detector_node', 'viewer_node')]
CASES = [(node, topic) + case for node, topic, cases in INPUTS for case in cases]


class Rig(object):
    """A node without a master, and its warnings."""

    def __init__(self, connections, name, warnings):
        self.warnings, self._target, self._connections = warnings, TARGETS[name], connections
        self._node, self._now_ns = self._target.make(None), START_NS

    def send(self, topic=None, change=None):
        """Send the messages of one image, of which one was changed."""
        self._now_ns += PERIOD_NS
        messages = hostile.good_messages(self._now_ns)
        if topic is not None:
            messages[topic] = change(messages[topic]) or messages[topic]
        send_image(self._connections, self._now_ns, messages)

    def has_answered(self):
        """Whether there is a result for the newest image."""
        if not self._target.output:
            return self._node._snapshots.newest.stamp_ns == self._now_ns
        newest = self._connections.publishers[self._target.output].newest
        stamp_ns = newest.header.stamp.to_nsec() if hasattr(newest, 'header') else boxes2d_from_msg(newest).stamp_ns
        return stamp_ns == self._now_ns


@pytest.fixture
def rig_of():
    """Makes the rig of a node."""
    warnings = []

    def made(name):
        connections = stack.enter_context(masterless(TARGETS[name].params))
        stack.enter_context(mock.patch('rospy.logwarn', lambda text, *values: warnings.append(text % values)))
        return Rig(connections, name, warnings)
    with contextlib.ExitStack() as stack, _quiet():
        yield made


@pytest.mark.parametrize('node, topic, change, reason', CASES)
def test_an_invalid_message_is_reported_and_the_next_one_is_processed(rig_of, node, topic, change, reason):
    rig = rig_of(node)
    for _image in range(5):
        rig.send()
    assert rig.has_answered() and not rig.warnings
    rig.send(topic, change)
    assert reason is None or any(reason in text for text in rig.warnings), rig.warnings
    rig.send()
    assert rig.has_answered()


@pytest.mark.parametrize('node', RGBD_NODES)
def test_camera_info_without_a_stamp_is_used_for_every_image(rig_of, node):
    """Intrinsics do not change with time; the image does not wait for the next camera_info."""
    rig = rig_of(node)
    for image in range(5):
        rig.send(INFO_TOPIC, stamped(0))
        assert image == 0 or rig.has_answered(), image
