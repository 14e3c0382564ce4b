"""Turn a measurement session into a rosbag, as if a Jackal with the camera stood in the map."""
import argparse
import os
import sys
from typing import NamedTuple, Tuple

import numpy as np
import rosbag
from geometry_msgs.msg import TransformStamped
from sensor_msgs.msg import CameraInfo, Image
from std_msgs.msg import Header
from tf2_msgs.msg import TFMessage

from ros_3d_bb.images import fill_image
from ros_3d_bb.measurements import SessionError, read_color, read_depth, read_session
from ros_3d_bb.messages import boxes2d_to_message, time_from
from ros_3d_bb.stamped import NS

START_NS = 1600000000 * NS  # any time will do, but the same for each bag of a session
MOUNT_M = (0.17, 0.0, 0.20)  # camera on a Jackal, metres forward, left and up of base_link (thesis 3.5.1)
OPTICAL_ROTATION = (-0.5, 0.5, -0.5, 0.5)  # quaternion of an optical frame that looks along the body's x (REP 103)
COLOR_TOPIC, DEPTH_TOPIC = '/camera/color/image_raw', '/camera/aligned_depth_to_color/image_raw'
INFO_TOPICS = ('/camera/color/camera_info', '/camera/aligned_depth_to_color/camera_info')
BOXES_TOPIC = '/yolo_bounding_box'


class BagOptions(NamedTuple):
    """How a session is written: frames per second; the camera in base_link (x forward, y left, z up), metres, looking
    straight ahead; whether the session's 2D boxes go to yolo_bounding_box; none, bz2 or lz4.
    """

    rate_hz: float = 30.0
    mount_m: Tuple[float, float, float] = MOUNT_M
    with_boxes: bool = False
    compression: str = 'lz4'


def write_bag(session, path, options=BagOptions()):
    """Write a session as a bag: colour, aligned depth, camera_info of both, and /tf.

    The bag is written beside its place and moved there when it is complete.

    Parameters
    ----------
    session : measurements.Session
    path : str
    options : BagOptions

    Returns
    -------
    int
        Number of frames written.

    Raises
    ------
    SessionError
        If an image cannot be read. No bag is left then.
    """
    partial = path + '.active'
    try:
        with rosbag.Bag(partial, 'w', compression=options.compression) as bag:
            for number, frame in enumerate(session.frames):
                stamp = time_from(START_NS + int(number * NS / options.rate_hz))
                for topic, message in _messages(session, frame, stamp, options):
                    bag.write(topic, message, stamp)
        os.replace(partial, path)
    finally:
        if os.path.exists(partial):
            os.remove(partial)
    return len(session.frames)


def _messages(session, frame, stamp, options):
    """Yield (topic, message) of one frame, in the order in which a robot would send them."""
    header = Header(stamp=stamp, frame_id=session.frame_id)
    yield '/tf', TFMessage(_transforms(header, options.mount_m))
    for topic in INFO_TOPICS:
        yield topic, _camera_info(session, header)
    yield DEPTH_TOPIC, _depth_image(read_depth(frame, session), header)
    yield COLOR_TOPIC, fill_image(Image(header=header), read_color(frame, session.camera), 'rgb8')
    if options.with_boxes:
        yield BOXES_TOPIC, boxes2d_to_message(np.array(frame.boxes_px, int).reshape(-1, 4), header)


def _depth_image(depth, header):
    """16UC1 where the camera counts millimetres, else metres as 32FC1 (REP 118)."""
    if depth.scale_m == 0.001:
        return fill_image(Image(header=header), depth.values, '16UC1')
    return fill_image(Image(header=header), (depth.values * depth.scale_m).astype(np.float32), '32FC1')


def _camera_info(session, header):
    camera = session.camera
    info = CameraInfo(header=header, width=camera.width, height=camera.height, distortion_model='plumb_bob')
    info.D = list(session.distortion) or [0.0] * 5
    info.K = [camera.fx, 0, camera.cx, 0, camera.fy, camera.cy, 0, 0, 1]
    info.R = [1, 0, 0, 0, 1, 0, 0, 0, 1]
    info.P = [camera.fx, 0, camera.cx, 0, 0, camera.fy, camera.cy, 0, 0, 0, 1, 0]
    return info


def _transforms(header, mount_m):
    """map <- odom <- base_link <- camera: the robot stands in the origin of the map."""
    chain = [('map', 'odom', (0, 0, 0), (0, 0, 0, 1)), ('odom', 'base_link', (0, 0, 0), (0, 0, 0, 1)),
             ('base_link', header.frame_id, mount_m, OPTICAL_ROTATION)]
    transforms = []
    for parent, child, translation, rotation in chain:
        message = TransformStamped(header=Header(stamp=header.stamp, frame_id=parent), child_frame_id=child)
        place, turn = message.transform.translation, message.transform.rotation
        place.x, place.y, place.z = translation
        turn.x, turn.y, turn.z, turn.w = rotation
        transforms.append(message)
    return transforms


def main():
    """The command `session_to_bag`."""
    parser = argparse.ArgumentParser(prog='session_to_bag', description=__doc__)
    parser.add_argument('session', help='folder of a measurement session, with frames.json')
    parser.add_argument('bag', help='the bag to write')
    parser.add_argument('--rate', type=float, default=30.0, metavar='HZ', help='frames per second (default: 30)')
    parser.add_argument('--mount', type=float, nargs=3, default=MOUNT_M, metavar=('X', 'Y', 'Z'),
                        help='camera in base_link, metres forward, left, up (default: 0.17 0 0.20, a Jackal)')
    parser.add_argument('--boxes', action='store_true', help="also write the session's 2D boxes to yolo_bounding_box")
    parser.add_argument('--compression', choices=('none', 'bz2', 'lz4'), default='lz4', help='default: lz4')
    arguments = parser.parse_args()
    if not arguments.rate > 0:
        parser.error('--rate %g: more than 0 expected' % arguments.rate)
    options = BagOptions(arguments.rate, tuple(arguments.mount), arguments.boxes, arguments.compression)
    try:
        count = write_bag(read_session(arguments.session), arguments.bag, options)
    except (SessionError, OSError) as error:
        print('session_to_bag: %s; no bag was written' % error, file=sys.stderr)
        sys.exit(1)
    print('%s: %d frames at %g Hz' % (arguments.bag, count, arguments.rate))
