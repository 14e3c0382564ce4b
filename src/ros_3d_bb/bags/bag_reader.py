"""Safe reader of bags from untrusted sources.

rosbag generates and executes Python code from each message definition in a bag. This reader does not use the
definitions: messages of known types are deserialized by the installed class, all others remain bytes.
"""
from typing import Any, Iterable, Iterator, NamedTuple, Optional, Tuple

import genpy
import rosbag
import rosbag.bag

from ros_3d_bb.conversions.camera_msgs import absolute
from ros_3d_bb.core.error_text import cause
from ros_3d_bb.core.params import nearest_name


class BagError(ValueError):
    """Bag that cannot be used. The message names the bag and the reason."""


class Raw(NamedTuple):
    """Serialized message and the header of its connection. `time` is the time of recording."""

    topic: str
    datatype: str
    md5sum: str
    data: bytes
    time: genpy.Time
    connection_header: Any


# Replaces the classes that rosbag would generate from the definitions in a bag.
UNREAD = type('Unread', (), {'_md5sum': '*', '_full_text': ''})


class BagReader(object):
    """Open bag, a context manager; `topics` is {name: type}. Raises BagError if the bag cannot be opened.

    Names have a leading slash. `rosbag record` stores them as they are given, with or without.
    """

    def __init__(self, path: str) -> None:
        self._path = path
        try:
            self._bag = rosbag.Bag(path)
            if self._bag.version != 200:
                raise ValueError('its format has the version %s; 200 (2.0) expected' % self._bag.version)
            connections = list(self._bag._get_connections())
            self.topics = {absolute(connection.topic): connection.datatype for connection in connections}
            self._stored_names = set(connection.topic for connection in connections)
            self._unread = set(connection.md5sum for connection in connections) - set(rosbag.bag._message_types)
            rosbag.bag._message_types.update((md5sum, UNREAD) for md5sum in self._unread)
        except rosbag.ROSBagUnindexedException:
            raise BagError('%s has no index, because its recording was interrupted; repair it with: rosbag reindex'
                           % path)
        except Exception as error:  # a damaged file can cause any exception
            raise BagError('%s is not a readable bag (%s)' % (path, cause(error)))

    def __enter__(self) -> 'BagReader':
        return self

    def __exit__(self, *_error: Any) -> None:
        for md5sum in self._unread:
            rosbag.bag._message_types.pop(md5sum, None)
        self._bag.close()

    @property
    def span_ns(self) -> Tuple[int, int]:
        """Times of recording of the first and the last message in nanoseconds; (0, 0) for an empty bag."""
        if not self._bag.get_message_count():
            return 0, 0
        return int(1e9 * self._bag.get_start_time()), int(1e9 * self._bag.get_end_time())

    def check_topic(self, topic: str, *kinds: Any) -> None:
        """Raise BagError if a bag has no such topic of these message classes. The error names topics of these types."""
        types = [kind._type for kind in kinds]
        if self.topics.get(topic) in types:
            return
        others = sorted(name for name, datatype in self.topics.items() if datatype in types)
        raise BagError('%s has no %s on %s; %s' % (
            self._path, ' or '.join(types), topic, 'did you mean %s? Remap it with --remap. Topics of this type: %s'
            % (nearest_name(topic, others), ', '.join(others)) if others else 'it has no topic of this type'))

    def messages(self, topics: Optional[Iterable[str]] = None) -> Iterator[Raw]:
        """Yield the messages (Raw) of all or some topics in the order of recording. Raises BagError."""
        names = None if topics is None else [name for name in self._stored_names if absolute(name) in topics]
        if names == []:  # rosbag would read all topics
            return
        entries = self._bag.read_messages(names, raw=True, return_connection_header=True)
        while True:
            try:
                entry = next(entries)
                datatype, data, md5sum = entry.message[:3]
            except StopIteration:
                return
            except MemoryError:
                raise
            except Exception as error:  # as above
                raise BagError('%s is damaged (%s)' % (self._path, cause(error)))
            yield Raw(absolute(entry.topic), datatype, md5sum, data, entry.timestamp, entry.connection_header)


def message_in(raw: Raw, *kinds: Any) -> Any:
    """Deserialize a Raw as one of some message classes. Raises ValueError if its type differs, or it is damaged.

    Its name may differ: /tf of old bags is a tf/tfMessage, which has the definition of tf2_msgs/TFMessage.
    """
    kind = next((kind for kind in kinds if raw.md5sum == kind._md5sum), None)
    if kind is None:
        raise ValueError('%s has messages of type %s (%s); %s expected'
                         % (raw.topic, raw.datatype, raw.md5sum,
                            ' or '.join('%s (%s)' % (kind._type, kind._md5sum) for kind in kinds)))
    try:
        return kind().deserialize(raw.data)
    except Exception as error:  # errors of genpy, struct, and UTF-8 decoding
        raise ValueError('a message on %s is damaged (%s)' % (raw.topic, cause(error)))
