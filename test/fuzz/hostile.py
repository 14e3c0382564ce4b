"""Random invalid messages, determined by a seed. All of them can be serialized."""
import copy
import random

import genpy
import numpy as np
from geometry_msgs.msg import (Point, Pose, PoseWithCovariance, Quaternion, Transform, TransformStamped, Twist,
                               Vector3)
from sensor_msgs.msg import CompressedImage, LaserScan, PointField, RegionOfInterest
from std_msgs.msg import Header, Int32MultiArray, MultiArrayDimension
from tf2_msgs.msg import TFMessage

from ros_3d_bb.camera.camera_model import Camera
from ros_3d_bb.camera.depth_image import DepthImage
from ros_3d_bb.camera.distortion import MODELS
from ros_3d_bb.conversions.camera_msgs import COLOR_TOPIC, DEPTH_TOPIC, INFO_TOPICS, CameraFrame, messages_of
from ros_3d_bb.conversions.image_msgs import LAYOUTS
from ros_3d_bb.conversions.perception_msgs import (BOXES3D_TOPIC, BOXES_TOPIC, TRACKS_TOPIC, boxes2d_to_msg,
                                                   time_from)
from ros_3d_bb.conversions.planner_msgs import points_to_msg
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.msg import BoundingBox3D, BoundingBox3DArray, TrackedObject, TrackedObjectArray
from support.compressed import compressed_fields

FLOATS = (0.0, -0.0, 1.0, -1.0, 0.5, 3.0, float('nan'), float('inf'), -float('inf'), 1e308, -1e308, 5e-324, 1e-30, 1e6)
INT32 = (0, 1, -1, 3, 10, 47, 48, 63, 64, 65, 1000, 2 ** 31 - 1, -2 ** 31)
UINT32 = (0, 1, 2, 47, 48, 64, 65535, 2 ** 31, 2 ** 32 - 1)
TEXTS = ('', 'camera', 'map', '/camera', 'no_such_frame', 'a b', '\u00e4\u0661', 'x' * 1000, '%s%n', "'; --", 'a=b;c')
NAMES = ('person', 'dog', '', 'a;b', 'x' * 65, '\u9f8d', 'do\x07g')
SCORES = ('0.5', '0', '1', '1.5', '-1', 'nan', 'inf', '1e400', '', 'high', '\u0661')
WIDTH, HEIGHT = 64, 48
CODECS = {COLOR_TOPIC: ('jpeg', 'png'), DEPTH_TOPIC: ('png', 'compressedDepth', 'compressedDepth rvl')}
FORMATS = ('jpeg', 'png', 'rgb8; jpeg compressed bgr8', 'bayer_rggb8; png compressed ', '16UC1; png compressed ',
           '16UC1; compressedDepth', '16UC1; compressedDepth rvl', '32FC1; compressedDepth',
           '32FC1; compressedDepth rvl')
CAMERA = Camera(WIDTH, HEIGHT, 60.0, 60.0, 31.5, 23.5)


class Source(random.Random):
    """Random values, many of them extreme. The same seed gives the same values."""

    def __init__(self, seed):
        super(Source, self).__init__(seed)
        self.noise = np.random.RandomState(seed).randint(0, 256, 2 ** 16).astype(np.uint8).tobytes()

    def number(self):
        """A float."""
        return self.choice(FLOATS) if self.random() < 0.4 else self.gauss(0, 3)

    def numbers(self, count):
        """Several floats."""
        return [self.number() for _number in range(count)]

    def score(self):
        """A float32 that mostly is a score."""
        with np.errstate(over='ignore'):
            return float(np.float32(self.random() if self.random() < 0.5 else self.number()))

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

    def header(self, now_ns):
        """A header, mostly with the frame of the camera."""
        return Header(stamp=self.stamp(now_ns), frame_id='camera' if self.random() < 0.8 else self.choice(TEXTS))


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
    messages[TRACKS_TOPIC] = TrackedObjectArray(header=header)
    messages['~scan'] = LaserScan(header=header, angle_increment=0.1, ranges=[1.0, 2.0, 3.0])
    messages['~points'] = points_to_msg(np.ones((3, 3)), header)
    messages['~depth'], messages['~camera_info'] = messages[DEPTH_TOPIC], messages[INFO_TOPICS[0]]
    messages['cmd_vel_in'] = Twist(linear=Vector3(0.5, 0, 0), angular=Vector3(0, 0, 0.1))
    return messages


def transforms(stamp_ns):
    """Transforms from the map to the camera."""
    message = TFMessage()
    for parent, child, quaternion in (('map', 'base_link', (0, 0, 0, 1)),
                                      ('base_link', 'camera', (-0.5, 0.5, -0.5, 0.5))):
        message.transforms.append(TransformStamped(Header(stamp=time_from(stamp_ns), frame_id=parent), child,
                                                   Transform(Vector3(), Quaternion(*quaternion))))
    return message


def makers(source, now_ns, good, compressed_share=0.0):
    """{topic: function that makes an invalid message}; `good` are the messages of a valid image."""
    def image_on(topic):
        is_compressed = source.random() < compressed_share
        return (compressed_image(source, now_ns, good[topic], source.choice(CODECS[topic])) if is_compressed
                else image(source, now_ns, good[topic]))
    return {INFO_TOPICS[0]: lambda: camera_info(source, now_ns, good[INFO_TOPICS[0]]),
            DEPTH_TOPIC: lambda: image_on(DEPTH_TOPIC), COLOR_TOPIC: lambda: image_on(COLOR_TOPIC),
            BOXES_TOPIC: lambda: boxes2d(source, now_ns), BOXES3D_TOPIC: lambda: boxes3d(source, now_ns),
            TRACKS_TOPIC: lambda: tracks(source, now_ns),
            '~scan': lambda: LaserScan(header=source.header(now_ns), angle_min=source.score(),
                                       angle_increment=source.score(),
                                       ranges=[source.score() for _beam in range(source.choice((0, 3)))]),
            '~points': lambda: cloud(source, now_ns), '~depth': lambda: image_on(DEPTH_TOPIC),
            '~camera_info': lambda: camera_info(source, now_ns, good[INFO_TOPICS[0]]),
            'cmd_vel_in': lambda: Twist(Vector3(*source.numbers(3)), Vector3(*source.numbers(3)))}


def image(source, now_ns, good):
    """A mostly damaged copy of a valid image."""
    message = copy.copy(good)
    message.header = source.header(now_ns)
    _damage(source, message, (
        lambda: {'encoding': source.choice(tuple(LAYOUTS) + TEXTS)},
        lambda: {'step': source.choice(UINT32 + (max(message.step, 1) - 1, min(message.step, 2 ** 31) + 1))},
        lambda: {'data': message.data[:source.randrange(len(message.data) + 1)]},
        lambda: {'width': source.choice(UINT32)},
        lambda: {'height': source.choice(UINT32)},
        lambda: {'is_bigendian': source.choice((1, 255))},
        lambda: {'data': source.bytes_of(len(message.data))},
        lambda: _extreme_pixels(source, message.height % 64, message.width % 64)))
    return message


def compressed_image(source, now_ns, good, codec):
    """A mostly damaged compressed copy of a valid image."""
    message = CompressedImage(**dict(compressed_fields(good, codec), header=source.header(now_ns)))

    def other_bytes():
        at, count = source.randrange(len(message.data) + 1), source.choice((1, 2, 4, 40))
        return {'data': message.data[:at] + source.bytes_of(count) + message.data[at + count:]}

    _damage(source, message, (
        other_bytes,
        lambda: {'format': source.choice(FORMATS + tuple(LAYOUTS) + TEXTS)},
        lambda: {'data': message.data[:source.randrange(len(message.data) + 1)]},
        lambda: {'data': source.bytes_of(len(message.data))}))
    return message


def _extreme_pixels(source, height, width):
    values = np.array([source.choice(FLOATS) for _column in range(16)])
    with np.errstate(over='ignore'):
        pixels = np.resize(values.astype(np.float32), (height, width))
    return {'height': height, 'width': width, 'encoding': '32FC1', 'step': 4 * width, 'data': pixels.tobytes()}


def camera_info(source, now_ns, good):
    """A mostly damaged copy of a valid camera_info."""
    message = copy.copy(good)
    message.header = source.header(now_ns)

    def other_matrix():
        matrix = list(message.K)
        matrix[source.randrange(9)] = source.number()
        return {'K': matrix}

    _damage(source, message, (
        other_matrix,
        lambda: {'width': source.choice(UINT32)},
        lambda: {'height': source.choice(UINT32)},
        lambda: {'distortion_model': source.choice(tuple(MODELS) + TEXTS)},
        lambda: {'D': source.numbers(source.choice((0, 1, 4, 5, 8, 12, 14, 100)))}))
    return message


def _damage(source, message, faults):
    """Replace fields of a message by those of up to two faults, functions that return {field: value}."""
    for _fault in range(source.choice((0, 1, 1, 2))):
        for name, value in source.choice(faults)().items():
            setattr(message, name, value)


def boxes2d(source, now_ns):
    """2D boxes."""
    count = 10 ** 6 if source.random() < 0.0002 else source.choice((0, 1, 2, 3, 4, 4, 4, 4, 8, 8, 12, 13, 400, 4004))
    if count > 400:
        return Int32MultiArray(data=[source.choice(INT32)] * count)
    message = Int32MultiArray(data=[source.choice(INT32) if source.random() < 0.5 else source.randrange(-5, 70)
                                    for _number in range(count)])
    if source.random() < 0.8:
        stamp = source.stamp(now_ns)
        label = 'boxes;stamp=%d.%09d;frame=%s' % (stamp.secs, stamp.nsecs, source.choice(TEXTS))
        if source.random() < 0.5:
            label += ';classes=' + ','.join(source.choice(NAMES) for _box in range(source.choice((1, count // 4))))
            label += ';scores=' + ','.join(source.choice(SCORES) for _box in range(source.choice((1, count // 4))))
        if source.random() < 0.2:
            label = source.choice((label[:source.randrange(len(label))], 'boxes;stamp=%s.000000000' % ('9' * 100),
                                   'boxes;stamp=\u0661.' + 9 * '\u00b2', ';' * 50, 'stamp=1.000000000;stamp=x') + TEXTS)
        message.layout.dim = [MultiArrayDimension(label=label, size=source.choice(UINT32))]
        message.layout.data_offset = source.choice(UINT32)
    return message


def boxes3d(source, now_ns):
    """3D boxes."""
    message = BoundingBox3DArray(header=source.header(now_ns))
    for _box in range(source.choice((0, 1, 1, 2, 5))):
        position = Point(source.gauss(0, 1), source.gauss(0, 0.3), abs(source.gauss(3, 1)))
        box = BoundingBox3D(support=float(np.float32(source.random())), truncated=source.random() < 0.3,
                            center=Pose(position, Quaternion(w=1)), size=Vector3(0.5, 1.7, 0.5))
        _damage(source, box, (
            lambda: {'center': Pose(Point(*source.numbers(3)), Quaternion(w=1))},
            lambda: {'center': Pose(position, Quaternion(*source.numbers(4)))},
            lambda: {'size': Vector3(*source.numbers(3))},
            lambda: {'position_covariance': source.numbers(9)},
            lambda: {'label': source.choice(NAMES + TEXTS), 'score': source.score()},
            lambda: {'roi': RegionOfInterest(*[source.choice(UINT32) for _edge in range(4)], False)}))
        message.boxes.append(box)
    return message


def cloud(source, now_ns):
    """A mostly damaged point cloud."""
    message = points_to_msg(np.array(source.numbers(9)).reshape(3, 3).clip(-1e30, 1e30), source.header(now_ns))
    _damage(source, message, (
        lambda: {'height': source.choice(UINT32)}, lambda: {'width': source.choice(UINT32)},
        lambda: {'point_step': source.choice(UINT32)}, lambda: {'row_step': source.choice(UINT32)},
        lambda: {'data': source.bytes_of(source.choice((0, 1, 36)))}, lambda: {'is_bigendian': True},
        lambda: {'fields': [PointField(name, source.choice(UINT32), source.choice((7, 8)), 1) for name in 'xyz']}))
    return message


def tracks(source, now_ns):
    """Tracks."""
    message = TrackedObjectArray(header=source.header(now_ns))
    for _track in range(source.choice((0, 1, 2))):
        track = TrackedObject(
            id=source.choice(UINT32), status=source.choice((0, 1, 2, 3, 255)), moving=source.random() < 0.5,
            size=Vector3(0.5, 0.5, 1.7),
            prediction_step=source.choice((genpy.Duration(0, NS // 4), genpy.Duration(), genpy.Duration(-5),
                                           genpy.Duration(2 ** 31 - 1))),
            prediction=[PoseWithCovariance() for _step in range(source.choice((0, 1, 8)))])
        if source.random() < 0.5:
            part = source.choice((track.pose.pose.position, track.twist.twist.linear, track.size)
                                 + tuple(pose.pose.position for pose in track.prediction))
            part.x, part.y, part.z = source.numbers(3)
        if source.random() < 0.3:
            track.label, track.score = source.choice(NAMES + TEXTS), source.score()
        if source.random() < 0.3:
            track.pose.covariance, track.twist.covariance = source.numbers(36), source.numbers(36)
        for pose in track.prediction if source.random() < 0.3 else ():
            pose.covariance = source.numbers(36)
        message.objects.append(track)
    return message
