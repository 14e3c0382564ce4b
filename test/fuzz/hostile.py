"""Messages that a node should not get, made from a seed. Each is one that can be sent."""
import random

import genpy
import numpy as np
from sensor_msgs.msg import CameraInfo, Image
from std_msgs.msg import Header, Int32MultiArray, MultiArrayDimension

from ros_3d_bb.camera.camera_model import Camera
from ros_3d_bb.camera.depth_image import DepthImage
from ros_3d_bb.camera.distortion import MODELS
from ros_3d_bb.conversions.camera_msgs import CameraFrame, messages_of
from ros_3d_bb.conversions.image_msgs import LAYOUTS
from ros_3d_bb.conversions.perception_msgs import time_from
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.msg import BoundingBox3D, BoundingBox3DArray, TrackedObject, TrackedObjectArray

FLOATS = (0.0, -0.0, 1.0, -1.0, 0.5, 3.0, float('nan'), float('inf'), -float('inf'), 1e308, -1e308, 5e-324, 1e-30, 1e6)
INT32 = (0, 1, -1, 3, 10, 47, 48, 63, 64, 65, 1000, 2 ** 31 - 1, -2 ** 31)
UINT32 = (0, 1, 2, 47, 48, 64, 65535, 2 ** 31, 2 ** 32 - 1)
TEXTS = ('', 'camera', 'map', '/camera', 'no_such_frame', 'a b', '\u00e4\u0661', 'x' * 1000, '%s%n', "'; --", 'a=b;c')
WIDTH, HEIGHT = 64, 48
CAMERA = Camera(WIDTH, HEIGHT, 60.0, 60.0, 31.5, 23.5)


class Source(random.Random):
    """Random values, of which many are extreme. The same seed gives the same ones."""

    def __init__(self, seed):
        super(Source, self).__init__(seed)
        self.noise = np.random.RandomState(seed).randint(0, 256, 2 ** 16).astype(np.uint8).tobytes()

    def number(self):
        """A float."""
        return self.choice(FLOATS) if self.random() < 0.4 else self.gauss(0, 3)

    def bytes_of(self, count):
        """So many bytes, at most 65536."""
        start = self.randrange(max(1, len(self.noise) - count))
        return self.noise[start:start + count]

    def stamp(self, now_ns):
        """The stamp at hand, or another: zero, of the future, of the past, of the end of time."""
        kind = self.random()
        if kind < 0.7:
            return time_from(now_ns)
        return self.choice((genpy.Time(), time_from(now_ns + 10 * NS), time_from(now_ns - NS // 2),
                            time_from(now_ns - 5 * NS), genpy.Time(2 ** 32 - 1, NS - 1), genpy.Time(0, 1)))

    def header(self, now_ns):
        """A header, mostly with the camera's frame."""
        return Header(stamp=self.stamp(now_ns), frame_id='camera' if self.random() < 0.8 else self.choice(TEXTS))


def good_frame(stamp_ns, frame_id='camera'):
    """{topic: message} of an image that shows a person 2 m away, as a robot sends it."""
    depth_mm = np.full((HEIGHT, WIDTH), 4000, np.uint16)
    depth_mm[8:44, 26:38] = 2000
    header = Header(stamp=time_from(stamp_ns), frame_id=frame_id)
    return dict(messages_of(CameraFrame(header, CAMERA, np.full((HEIGHT, WIDTH, 3), 90, np.uint8),
                                        DepthImage(depth_mm, 0.001), [])))


def good_boxes(stamp_ns):
    """The 2D boxes that belong to `good_frame`."""
    message = Int32MultiArray(data=[26, 8, 38, 44])
    message.layout.dim = [MultiArrayDimension(label='boxes;stamp=%d.%09d;frame=camera' % divmod(stamp_ns, NS), size=1)]
    return message


def image(source, now_ns, good):
    """An image like a good one, mostly damaged."""
    message = Image(source.header(now_ns), good.height, good.width, good.encoding, 0, good.step, good.data)
    for _fault in range(source.choice((0, 1, 1, 2))):
        fault = source.randrange(8)
        if fault == 0:
            message.encoding = source.choice(tuple(LAYOUTS) + TEXTS)
        elif fault == 1:
            message.step = source.choice(UINT32 + (max(message.step, 1) - 1, min(message.step, 2 ** 31) + 1))
        elif fault == 2:
            message.data = message.data[:source.randrange(len(message.data) + 1)]
        elif fault == 3:
            message.width = source.choice(UINT32)
        elif fault == 4:
            message.height = source.choice(UINT32)
        elif fault == 5:
            message.is_bigendian = source.choice((1, 255))
        elif fault == 6:
            message.data = source.bytes_of(len(message.data))
        else:
            values = np.array([source.choice(FLOATS) for _column in range(16)])
            with np.errstate(over='ignore'):
                pixels = np.resize(values.astype(np.float32), (message.height % 64, message.width % 64))
            message.height, message.width, message.encoding = pixels.shape + ('32FC1',)
            message.step, message.data = 4 * message.width, pixels.tobytes()
    return message


def camera_info(source, now_ns, good):
    """A camera_info like a good one, mostly damaged."""
    message = CameraInfo(header=source.header(now_ns), height=good.height, width=good.width, K=list(good.K),
                         distortion_model=good.distortion_model, D=good.D, R=good.R, P=good.P)
    for _fault in range(source.choice((0, 1, 1, 2))):
        fault = source.randrange(5)
        if fault == 0:
            message.K[source.randrange(9)] = source.number()
        elif fault == 1:
            message.width = source.choice(UINT32)
        elif fault == 2:
            message.height = source.choice(UINT32)
        elif fault == 3:
            message.distortion_model = source.choice(tuple(MODELS) + TEXTS)
        else:
            message.D = [source.number() for _number in range(source.choice((0, 1, 4, 5, 8, 12, 14, 100)))]
    return message


def boxes2d(source, now_ns):
    """An array of 2D boxes."""
    count = 10 ** 6 if source.random() < 0.0002 else source.choice((0, 1, 2, 3, 4, 4, 4, 4, 8, 8, 12, 13, 400, 4004))
    if count > 400:
        return Int32MultiArray(data=[source.choice(INT32)] * count)
    message = Int32MultiArray(data=[source.choice(INT32) if source.random() < 0.5 else source.randrange(-5, 70)
                                    for _number in range(count)])
    if source.random() < 0.8:
        stamp = source.stamp(now_ns)
        label = 'boxes;stamp=%d.%09d;frame=%s' % (stamp.secs, stamp.nsecs, source.choice(TEXTS))
        if source.random() < 0.2:
            label = source.choice((label[:source.randrange(len(label))], 'boxes;stamp=%s.000000000' % ('9' * 100),
                                   'boxes;stamp=\u0661.' + 9 * '\u00b2', ';' * 50, 'stamp=1.000000000;stamp=x') + TEXTS)
        message.layout.dim = [MultiArrayDimension(label=label, size=source.choice(UINT32))]
        message.layout.data_offset = source.choice(UINT32)
    return message


def _fill(source, part, names):
    for name in names:
        setattr(part, name, source.number())


def boxes3d(source, now_ns):
    """An array of 3D boxes."""
    message = BoundingBox3DArray(header=source.header(now_ns))
    for _box in range(source.choice((0, 1, 1, 2, 5))):
        box = BoundingBox3D(support=float(np.float32(min(source.random(), 1))), truncated=source.random() < 0.3)
        place, size = box.center.position, box.size
        place.x, place.y, place.z = source.gauss(0, 1), source.gauss(0, 0.3), abs(source.gauss(3, 1))
        size.x, size.y, size.z, box.center.orientation.w = 0.5, 1.7, 0.5, 1.0
        for _fault in range(source.choice((0, 0, 1, 2))):
            fault = source.randrange(5)
            if fault == 0:
                _fill(source, place, 'xyz')
            elif fault == 1:
                _fill(source, size, 'xyz')
            elif fault == 2:
                _fill(source, box.center.orientation, 'xyzw')
            elif fault == 3:
                box.position_covariance = [source.number() for _number in range(9)]
            else:
                _fill_roi(source, box.roi)
        message.boxes.append(box)
    return message


def _fill_roi(source, roi):
    roi.x_offset, roi.y_offset, roi.width, roi.height = (source.choice(UINT32) for _edge in range(4))


def tracks(source, now_ns):
    """An array of tracks."""
    message = TrackedObjectArray(header=source.header(now_ns))
    for _track in range(source.choice((0, 1, 2))):
        track = TrackedObject(id=source.choice(UINT32), status=source.choice((0, 1, 2, 3, 255)),
                              moving=source.random() < 0.5)
        track.size.x = track.size.y = 0.5
        track.size.z = 1.7
        track.prediction_step = source.choice((genpy.Duration(0, NS // 4), genpy.Duration(), genpy.Duration(-5),
                                               genpy.Duration(2 ** 31 - 1)))
        track.prediction = [type(track.pose)() for _step in range(source.choice((0, 1, 8)))]
        if source.random() < 0.5:
            part = source.choice((track.pose.pose.position, track.twist.twist.linear, track.size)
                                 + tuple(pose.pose.position for pose in track.prediction))
            _fill(source, part, 'xyz')
        if source.random() < 0.3:
            track.pose.covariance = [source.number() for _number in range(36)]
            track.twist.covariance = [source.number() for _number in range(36)]
        message.objects.append(track)
    return message
