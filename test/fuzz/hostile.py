"""Valid messages, and copies of them with random faults, determined by a seed. All of them can be serialized."""
import copy
import random

import genpy
import numpy as np
from geometry_msgs.msg import Point, Pose, Quaternion, Twist, Vector3
from sensor_msgs.msg import LaserScan
from std_msgs.msg import Header
from tf2_msgs.msg import TFMessage

from ros_3d_bb.camera.camera_model import OPTICAL_ROTATION, Camera, transform_from
from ros_3d_bb.camera.images import DepthImage
from ros_3d_bb.conversions.camera_msgs import DEPTH_TOPIC, INFO_TOPICS, CameraFrame, messages_of, transform_messages
from ros_3d_bb.conversions.perception_msgs import (BOXES3D_TOPIC, BOXES_TOPIC, TRACKS_TOPIC, boxes2d_to_msg,
                                                   time_from)
from ros_3d_bb.conversions.planner_msgs import points_to_msg
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.msg import BoundingBox3D, BoundingBox3DArray, TrackedObjectArray
from support.masterless import on_the_wire
from support.ros import person

FLOATS = (0.0, -0.0, 1.0, -1.0, 0.5, 3.0, float('nan'), float('inf'), -float('inf'), 1e308, -1e308, 5e-324, 1e-30, 1e6)
INTEGERS = (0, 1, -1, 3, 7, 8, 10, 47, 48, 63, 64, 65, 255, 1000, 65535, 2 ** 31)  # and the limits of each type
TEXTS = ('', 'camera', 'map', '/camera', 'no_such_frame', 'a b', '\u00e4\u0661', 'x' * 1000, '%s%n', "'; --", 'a=b;c',
         'dog', 'do\x07g', ';classes=dog,', ';scores=nan', 'stamp=1.000000000;stamp=x', 'rgb8', '16UC1', 'bayer_rggb8',
         'jpeg', 'plumb_bob', 'equidistant')
WIDTH, HEIGHT = 64, 48
CAMERA = Camera(WIDTH, HEIGHT, 60.0, 60.0, 31.5, 23.5)


class Source(random.Random):
    """Random values, many of them extreme. The same seed gives the same values."""

    def __init__(self, seed):
        super(Source, self).__init__(seed)
        self.noise = np.random.RandomState(seed).randint(0, 256, 2 ** 16).astype(np.uint8).tobytes()

    def number(self):
        """A float."""
        return self.choice(FLOATS) if self.random() < 0.4 else self.gauss(0, 3)

    def bytes_of(self, count):
        """At most 65536 bytes."""
        start = self.randrange(max(1, len(self.noise) - count))
        return self.noise[start:start + count]

    def stamp(self, now_ns):
        """Mostly the current stamp, or zero, in the future, in the past, or the largest or the smallest one."""
        if self.random() < 0.7:
            return time_from(now_ns)
        return self.choice((genpy.Time(), time_from(now_ns + 10 * NS), time_from(now_ns - NS // 2),
                            time_from(now_ns - 5 * NS), genpy.Time(2 ** 32 - 1, NS - 1), genpy.Time(0, 1)))


def good_messages(stamp_ns):
    """Messages {topic: message} of a valid image of a person at 2 m, its boxes and tracks, in the order of sending."""
    depth_mm = np.full((HEIGHT, WIDTH), 4000, np.uint16)
    depth_mm[8:44, 26:38] = 2000
    header = Header(stamp=time_from(stamp_ns), frame_id='camera')
    image_header = copy.copy(header)
    messages = dict(messages_of(CameraFrame(image_header, CAMERA, np.full((HEIGHT, WIDTH, 3), 90, np.uint8),
                                            DepthImage(depth_mm, 0.001), [])))
    messages[BOXES_TOPIC] = boxes2d_to_msg(np.array([[26, 8, 38, 44]]), header)
    box = BoundingBox3D(center=Pose(Point(0, 0, 3), Quaternion(w=1)), size=Vector3(0.5, 1.7, 0.5))
    messages[BOXES3D_TOPIC] = BoundingBox3DArray(header=header, boxes=[box])
    messages[TRACKS_TOPIC] = TrackedObjectArray(header=header, objects=[person(1, 2.0, 0.0)])
    messages['~scan'] = LaserScan(header=header, angle_increment=0.1, ranges=[1.0, 2.0, 3.0])
    messages['~points'] = points_to_msg(np.ones((3, 3)), header)
    messages['~depth'], messages['~camera_info'] = messages[DEPTH_TOPIC], messages[INFO_TOPICS[0]]
    messages['cmd_vel_in'] = Twist(linear=Vector3(0.5, 0, 0), angular=Vector3(0, 0, 0.1))
    return messages


def transforms(stamp_ns):
    """Transforms from the map to the camera."""
    return TFMessage(transform_messages(time_from(stamp_ns), [
        ('map', 'base_link', np.eye(4)), ('base_link', 'camera', transform_from((0, 0, 0), OPTICAL_ROTATION))]))


def damaged(source, message, now_ns):
    """A copy of a valid message, in which up to two fields of it or of its parts have other values."""
    message = on_the_wire(message)
    for _fault in range(source.choice((0, 1, 1, 2))):
        part, name, kind = source.choice(list(_fields(message)))
        setattr(part, name, _other(source, kind, getattr(part, name), now_ns))
    return message


def _fields(message):
    """Yield (part, name, type) for each field of a message and of its parts."""
    for name, kind in zip(message.__slots__, message._slot_types):
        yield message, name, kind
        value = getattr(message, name)
        for part in value if isinstance(value, list) else [value]:
            if isinstance(part, genpy.Message):
                for field in _fields(part):
                    yield field


def _other(source, kind, value, now_ns):
    """Another value of a field of a type such as `float64[9]`."""
    if kind.endswith(']'):
        return _other_array(source, kind, value, now_ns)
    if '/' in kind:
        return type(value)()  # an empty message
    if kind == 'string':
        return source.choice(TEXTS + (value[:source.randrange(len(value) + 1)], value + source.choice(TEXTS)))
    if kind == 'time':
        return source.stamp(now_ns)
    if kind == 'duration':
        return source.choice((genpy.Duration(), genpy.Duration(-5), genpy.Duration(2 ** 31 - 1)))
    if kind.startswith('float'):
        with np.errstate(over='ignore'):
            return float(np.float32(source.number())) if kind == 'float32' else source.number()
    if 'int' in kind:
        bits = int(kind.lstrip('uint'))
        low, high = (0, 2 ** bits - 1) if kind.startswith('u') else (-2 ** (bits - 1), 2 ** (bits - 1) - 1)
        numbers = INTEGERS + (low, high, value - 1, value + 1)
        return source.choice([number for number in numbers if low <= number <= high])
    return not value


def _other_array(source, kind, value, now_ns):
    """Other bytes; or one other element, or fewer or more elements, unless the length is a part of the type."""
    at = source.randrange(len(value) + 1)
    if isinstance(value, bytes):
        other = source.bytes_of(source.choice((1, 4, 40)))
        return source.choice((value[:at], source.bytes_of(len(value)), value[:at] + other + value[at + len(other):]))
    element, _bracket, length = kind.partition('[')
    if at < len(value) and (length != ']' or source.random() < 0.5):
        return list(value[:at]) + [_other(source, element, value[at], now_ns)] + list(value[at + 1:])
    return list(value[:at]) * source.choice((1, 2, 100)) if length == ']' else value
