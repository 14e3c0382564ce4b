"""Write bags with the messages of a camera on a robot, for example from measurement sessions."""
import argparse
import collections
import contextlib
import os
import sys
from typing import Any, Callable, Dict, Iterable, Iterator, List, Optional, Sequence, Tuple

import numpy as np
import rosbag
from std_msgs.msg import Header

from ros_3d_bb.camera.camera_model import OPTICAL_ROTATION, transform_from
from ros_3d_bb.conversions.camera_msgs import START_NS, CameraFrame, messages_of
from ros_3d_bb.conversions.perception_msgs import BOXES_TOPIC, boxes2d_to_msg, time_from
from ros_3d_bb.core.atomic_file import clean_up_on_sigterm, replacement_of
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.sessions.session_reader import Session, read_color, read_depth, read_session

PARTIAL = '.active'  # suffix of incomplete bags, as in rosbag record
MOUNT_M = (0.17, 0.0, 0.20)  # position of the camera of a Jackal in base_link: forward, left, up (thesis 3.5.1)


def write_bag(images: Iterable[Any], path: str, compression: str = 'lz4') -> int:
    """Write `images`, an iterable of (stamp_ns, iterable of (topic, message)), to a bag, and return their number.

    If `images` raises an exception, no bag remains. `compression` is none, bz2 or lz4.
    """
    count = 0
    with new_bag(path, compression) as bag:
        for stamp_ns, messages in images:
            for topic, message in messages:
                bag.write('/' + topic, message, time_from(stamp_ns))
            count += 1
    return count


@contextlib.contextmanager
def new_bag(path: str, compression: str) -> Iterator[rosbag.Bag]:
    """Open a rosbag.Bag for writing. It has a temporary name until the block ends without an error."""
    with replacement_of(path, os.path.basename(path) + '.', PARTIAL) as partial:
        bag = rosbag.Bag(partial, 'w', compression=compression)
        try:
            yield bag
        except BaseException:
            with contextlib.suppress(Exception):  # after a failed write, as on a full disk
                bag.close()
            raise
        bag.close()


def images_in(path: str, topics: Sequence[str]) -> List[List[Tuple[str, Any]]]:
    """Read the messages of a bag on some topics, grouped by image: a list of lists of (topic, message).

    Topics have no leading slash. Raises ValueError if the bag cannot be read, or an image lacks one of the topics.
    """
    images: Dict[int, List[Tuple[str, Any]]] = collections.OrderedDict()
    try:
        with rosbag.Bag(path) as bag:
            for topic, message, stamp in bag.read_messages(['/' + topic for topic in topics]):
                images.setdefault(stamp.to_nsec(), []).append((topic[1:], message))
    except (OSError, rosbag.ROSBagException) as error:
        raise ValueError('the bag %s cannot be read: %s' % (path, error))
    for stamp_ns, messages in images.items():
        missing = set(topics) - set(topic for topic, _message in messages)
        if missing:
            raise ValueError('the image at %.3f in the bag %s has no %s; expected a bag written by scenario_to_bag or '
                             'session_to_bag' % (stamp_ns / NS, path, ', '.join(sorted(missing))))
    if not images:
        raise ValueError('the bag %s has no messages on %s' % (path, ', '.join(sorted(topics))))
    return list(images.values())


def session_images(session: Session, rate_hz: float = 30.0, mount_m: Sequence[float] = MOUNT_M,
                   with_boxes: bool = False) -> Iterator[Tuple[int, List[Tuple[str, Any]]]]:
    """Yield the images of a measurement session for `write_bag`, optionally with their 2D boxes.

    `mount_m` is the position of the forward-facing camera in base_link (x forward, y left, z up), metres. It is tilted
    as in the session. Raises SessionError if an image cannot be read.
    """
    for number, frame in enumerate(session.frames):
        base_from_camera = transform_from(mount_m, OPTICAL_ROTATION)
        base_from_camera[:3, :3] = base_from_camera[:3, :3].dot(frame.level_from_camera)
        chain = [('map', 'odom', np.eye(4)), ('odom', 'base_link', np.eye(4)),
                 ('base_link', session.frame_id, base_from_camera)]
        stamp_ns = START_NS + int(number * NS / rate_hz)
        header = Header(stamp=time_from(stamp_ns), frame_id=session.frame_id)
        messages = list(messages_of(CameraFrame(header, session.camera, read_color(frame, session.camera),
                                                read_depth(frame, session), chain)))
        if with_boxes:
            messages.append((BOXES_TOPIC, boxes2d_to_msg(np.array(frame.boxes_px, int).reshape(-1, 4), header)))
        yield stamp_ns, messages


def session_to_bag() -> None:
    """The command `session_to_bag`: convert a measurement session to a bag of a camera on a stationary Jackal."""
    parser = bag_command_parser('session_to_bag', session_to_bag.__doc__)
    parser.add_argument('session', help='folder of a measurement session, with frames.json')
    parser.add_argument('bag', help='bag to write')
    parser.add_argument('--rate', type=float, default=30.0, metavar='HZ', help='frames per second (default: 30)')
    parser.add_argument('--mount', type=float, nargs=3, default=MOUNT_M, metavar=('X', 'Y', 'Z'),
                        help='position of the camera in base_link, metres forward, left, up (default: 0.17 0 0.20, a '
                             'Jackal)')
    parser.add_argument('--boxes', action='store_true', help='also write the 2D boxes to yolo_bounding_box')
    arguments = parser.parse_args()
    if not arguments.rate > 0:
        parser.error('--rate %g: more than 0 expected' % arguments.rate)
    write_bag_of_command(parser, arguments, lambda: session_images(read_session(arguments.session), arguments.rate,
                                                                   arguments.mount, arguments.boxes))


def bag_command_parser(name: str, doc: Optional[str]) -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog=name, description=(doc or '').split(': ', 1)[-1])
    parser.add_argument('--compression', choices=('none', 'bz2', 'lz4'), default='lz4', help='default: lz4')
    return parser


def write_bag_of_command(parser: argparse.ArgumentParser, arguments: argparse.Namespace,
                         images: Callable[[], Iterable[Any]]) -> None:
    """Write the bag of a command. Print the cause and exit with 1 if a session or a scenario cannot be read."""
    clean_up_on_sigterm()
    try:
        count = write_bag(images(), arguments.bag, arguments.compression)
    except (ValueError, OSError) as error:
        print('%s: %s; no bag was written' % (parser.prog, error), file=sys.stderr)
        sys.exit(1)
    print('%s: %d images' % (arguments.bag, count))
