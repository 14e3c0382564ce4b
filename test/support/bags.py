"""Content of bags, and bags with changed messages."""
import rosbag


def messages_in(path, *topics):
    """{topic: messages} of a bag, by default of all topics."""
    by_topic = {}
    with rosbag.Bag(str(path)) as bag:
        for topic, message, _time in bag.read_messages(topics or None):
            by_topic.setdefault(topic, []).append(message)
    return by_topic


def changed_bag(source, target, change):
    """Write a bag of the messages that `change(topic, message, time)` returns, (topic, message, time) or None."""
    with rosbag.Bag(str(source)) as old, rosbag.Bag(str(target), 'w', compression='lz4') as new:
        for entry in old.read_messages():
            changed = change(*entry)
            if changed is not None:
                new.write(*changed)
    return str(target)
