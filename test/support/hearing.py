"""Command that waits for messages: `hearing.py SECONDS TOPIC[:FIELD] ...`.

The exit status is 0 once a message, with a field that is not empty, has arrived on each topic; otherwise 1.
"""
import sys
import time

import rospy
from genpy.message import get_message_class


def wait_for(wanted, seconds):
    """Names of `wanted`, a list of 'topic:field', on which nothing came in time."""
    missing, subscribers = set(wanted), {}
    deadline_s = time.monotonic() + seconds
    while missing and time.monotonic() < deadline_s and not rospy.is_shutdown():
        kinds = dict(rospy.get_published_topics())
        for name in sorted(missing - set(subscribers)):
            topic, _colon, field = name.partition(':')
            if rospy.resolve_name(topic) in kinds:
                subscribers[name] = rospy.Subscriber(topic, get_message_class(kinds[rospy.resolve_name(topic)]),
                                                     _checker(name, field, missing), buff_size=2 ** 24)
        time.sleep(0.1)
    return sorted(missing)


def _checker(name, field, missing):
    def check(message):
        value = getattr(message, field) if field else True
        if value if not hasattr(value, '__len__') else len(value):
            missing.discard(name)
    return check


if __name__ == '__main__':
    rospy.init_node('hearing', anonymous=True, disable_rosout=True, disable_signals=True)
    NOT_HEARD = wait_for(sys.argv[2:], float(sys.argv[1]))
    print('heard all' if not NOT_HEARD else 'never heard: %s' % ', '.join(NOT_HEARD))
    sys.exit(1 if NOT_HEARD else 0)
