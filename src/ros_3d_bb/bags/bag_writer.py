"""Write bags with the messages of a camera on a robot, and read their images."""
import collections
import contextlib
import os
from typing import Any, Dict, Iterable, Iterator, List, Sequence, Tuple

import rosbag

from ros_3d_bb.conversions.perception_msgs import time_from
from ros_3d_bb.core.atomic_file import replacement_of
from ros_3d_bb.core.time_sync import NS

PARTIAL = '.active'  # suffix of incomplete bags, as in rosbag record


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
            raise ValueError('the image at %.3f in the bag %s has no %s; expected a bag written by scenario_to_bag'
                             % (stamp_ns / NS, path, ', '.join(sorted(missing))))
    if not images:
        raise ValueError('the bag %s has no messages on %s' % (path, ', '.join(sorted(topics))))
    return list(images.values())
