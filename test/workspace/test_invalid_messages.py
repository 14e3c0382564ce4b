"""Nodes process a valid message at once after any invalid one."""
import genpy
import numpy as np
import pytest
from std_msgs.msg import Header

from ros_3d_bb.conversions.perception_msgs import boxes2d_from_msg, time_from
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.msg import BoundingBox3DArray
from ros_3d_bb.nodes.tracker_node import TrackerNode
from support.inputs import TARGETS, good_messages, send_image, transforms
from support.masterless import masterless, on_the_wire

START_NS, PERIOD_NS = 1000 * NS, NS // 30
TEXTS = '', 'no_such_frame', 'x' * 1000, 'do\x07g', ';stamp=1.000000000;stamp=x', ';scores=nan', 'bayer_rggb8'
FLOATS = float('nan'), -1.0, 3e38
DURATIONS = genpy.Duration(), genpy.Duration(-5), genpy.Duration(2 ** 31 - 1)
EXTREME_TIMES = genpy.Time(), genpy.Time(0, 1), genpy.Time(2 ** 32 - 1, NS - 1)
OFFSETS_S = -5, 3600


def fields_of(message):
    """Yield (part, name, type) for each field of a message and of its parts."""
    for name, kind in zip(message.__slots__, message._slot_types):
        value = getattr(message, name)
        yield message, name, kind
        for part in value if isinstance(value, list) else [value]:
            if isinstance(part, genpy.Message):
                for field in fields_of(part):
                    yield field


def others(kind, value, stamp_ns):
    element, bracket, length = kind.partition('[')
    if isinstance(value, bytes):
        return [value[:-1], value + bytes(40), bytes(len(value)), b'\xff' * len(value)]
    if bracket:
        firsts = others(element, value[0], stamp_ns) if len(value) else []
        changed = [[first] + list(value[1:]) for first in firsts]
        return changed if length != ']' else changed + [[], list(value[:-1]), list(value) * 100]
    if '/' in kind:
        return [type(value)()]
    if kind == 'time':
        return EXTREME_TIMES + tuple(time_from(stamp_ns + offset_s * NS) for offset_s in OFFSETS_S)
    if kind.startswith('float'):
        return FLOATS
    if 'int' in kind:
        bits = int(kind.lstrip('uint'))
        low, high = (0, 2 ** bits - 1) if kind.startswith('u') else (-2 ** (bits - 1), 2 ** (bits - 1) - 1)
        return {low, high}
    return {'string': TEXTS, 'duration': DURATIONS, 'bool': (not value,)}[kind]


def changes_of(message, stamp_ns):
    return [(number, value) for number, (part, name, kind) in enumerate(fields_of(message))
            for value in others(kind, getattr(part, name), stamp_ns)]


def changed(message, number, value):
    message = on_the_wire(message)
    part, name, _kind = list(fields_of(message))[number]
    setattr(part, name, value)
    return message


def has_processed(name, node, connections, stamp_ns):
    """Whether the newest result of a node is that of this stamp; True for nodes whose results have no stamp."""
    if name == 'viewer_node':
        return node._snapshots.newest.stamp_ns == stamp_ns
    newest = connections.publishers[TARGETS[name].output].newest if TARGETS[name].output else None
    if hasattr(newest, 'layout'):
        return boxes2d_from_msg(newest).stamp_ns == stamp_ns
    return not hasattr(newest, 'header') or newest.header.stamp == time_from(stamp_ns)


@pytest.mark.slow
@pytest.mark.parametrize('name', sorted(TARGETS))
def test_a_valid_message_is_processed_at_once_after_any_invalid_one(name):
    """In every second image, one field of one message has another value."""
    with masterless(TARGETS[name].params) as connections, np.errstate(all='ignore'):
        node, stamp_ns = TARGETS[name].make(), START_NS
        for topic in [topic for topic in good_messages(stamp_ns) if topic in connections.subscribers]:
            for count in range(len(changes_of(good_messages(stamp_ns)[topic], stamp_ns))):
                stamp_ns += 2 * PERIOD_NS
                messages = good_messages(stamp_ns)
                change = changes_of(messages[topic], stamp_ns)[count]
                messages[topic] = changed(messages[topic], *change)
                send_image(connections, stamp_ns, messages)
                send_image(connections, stamp_ns + PERIOD_NS)
                for _period_s, on_timer in connections.timers:
                    on_timer(None)
                assert has_processed(name, node, connections, stamp_ns + PERIOD_NS), (topic, change)
        assert not TARGETS[name].output or connections.publishers[TARGETS[name].output].count > count


@pytest.mark.parametrize('topic', ['/tf', '/tf_static'])
def test_transforms_with_stamps_that_tf2_cannot_represent_are_ignored(topic):
    """They raise an uncaught C++ exception in tf2, which terminates the process."""
    with masterless({'tf_timeout': 0.0}) as connections:
        TrackerNode()
        for secs in (2 ** 32 - 1, 2 ** 31, 100):
            connections.send(topic, transforms(secs * NS))
        connections.send('ros_3d_bb/bb_3d', BoundingBox3DArray(header=Header(stamp=genpy.Time(100), frame_id='camera')))
        assert connections.publishers['ros_3d_bb/tracks'].count == 1
