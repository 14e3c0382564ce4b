"""Read bags that somebody else may have made, message by message, and no more of them than is needed.

rosbag makes Python code of each message definition in a bag and runs it. Here no definition of a bag is used: messages
of a known type are read by the installed class, all others stay bytes.
"""
from typing import Any, NamedTuple

import genpy
import rosbag
import rosbag.bag

from ros_3d_bb.detection.checkpoint import cause
from ros_3d_bb.params import nearest_name


class BagError(ValueError):
    """A bag that cannot be used: says which, and why."""


class Raw(NamedTuple):
    """One message as it is in a bag, and the connection that it came by; `time` is when it was recorded."""

    topic: str
    datatype: str
    md5sum: str
    data: bytes
    time: genpy.Time
    connection_header: Any


class Unread(object):
    """Takes the place of the class that rosbag would make of a definition in a bag."""

    _md5sum, _full_text = '*', ''


class BagReader(object):
    """An open bag; to be used as a context. Raises BagError where it cannot be opened."""

    def __init__(self, path):
        self._path = path
        try:
            self._bag = rosbag.Bag(path)
            if self._bag.version != 200:
                raise ValueError('version %s of the format; 2.0 expected' % self._bag.version)
            self._types = {connection.topic: connection.datatype for connection in self._bag._get_connections()}
            self._unread = (set(connection.md5sum for connection in self._bag._get_connections())
                            - set(rosbag.bag._message_types))
            rosbag.bag._message_types.update((md5sum, Unread) for md5sum in self._unread)
        except rosbag.ROSBagUnindexedException:
            raise BagError('%s has no index, as its recording was cut off; mend it with: rosbag reindex' % path)
        except Exception as error:  # a damaged file can raise anything; it all means the same
            raise BagError('%s is no bag that can be read (%s)' % (path, cause(error)))

    def __enter__(self):
        return self

    def __exit__(self, *_error):
        for md5sum in self._unread:
            rosbag.bag._message_types.pop(md5sum, None)
        self._bag.close()

    @property
    def span_ns(self):
        """When the first and the last message were recorded, integer nanoseconds; 0 and 0 in an empty bag."""
        if not self._bag.get_message_count():
            return 0, 0
        return tuple(int(1e9 * time_s) for time_s in (self._bag.get_start_time(), self._bag.get_end_time()))

    @property
    def topics(self):
        """{name: type} of the topics in it."""
        return dict(self._types)

    def check_topic(self, topic, kind):
        """Raise BagError where a bag does not have a topic of messages of a class; name what it has instead."""
        if self._types.get(topic) == kind._type:
            return
        others = sorted(name for name, datatype in self._types.items() if datatype == kind._type)
        raise BagError('%s has no %s on %s; %s' % (
            self._path, kind._type, topic, 'did you mean %s? Name it with --remap. Of that type it has: %s'
            % (nearest_name(topic, others), ', '.join(others)) if others else 'it has none of that type'))

    def messages(self, topics=None):
        """Yield the messages (Raw) of all or of some topics in the order of their recording. Raises BagError."""
        entries = self._bag.read_messages(topics, raw=True, return_connection_header=True)
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
            yield Raw(entry.topic, datatype, md5sum, data, entry.timestamp, entry.connection_header)


def message_in(raw, kind):
    """The message of a class in a Raw. Raises ValueError where it is of another type, or damaged."""
    if (raw.datatype, raw.md5sum) != (kind._type, kind._md5sum):
        raise ValueError('%s has messages of type %s (%s); %s (%s) expected'
                         % (raw.topic, raw.datatype, raw.md5sum, kind._type, kind._md5sum))
    try:
        return kind().deserialize(raw.data)
    except Exception as error:  # genpy's own errors, struct's, and those of text that is no UTF-8
        raise ValueError('a message on %s is damaged (%s)' % (raw.topic, cause(error)))
