"""Content of bags, bags of simulated scenes, and bags with changed messages."""
import rosbag

from ros_3d_bb.bags.bag_writer import write_bag
from ros_3d_bb_lab.simulation.ros.scenario_to_bag import scenario_images
from ros_3d_bb_lab.simulation.scenario import scenario_from


def messages_in(path, *topics):
    """{topic: messages} of a bag, by default of all topics."""
    by_topic = {}
    with rosbag.Bag(str(path)) as bag:
        for topic, message, _time in bag.read_messages(topics or None):
            by_topic.setdefault(topic, []).append(message)
    return by_topic


def scene_bag(path, scene, with_boxes=False):
    """Write a bag of a scene, the content of a scenario file. Returns its path."""
    write_bag(scenario_images(scenario_from(scene), with_boxes), str(path))
    return str(path)


def changed_bag(source, target, change):
    """Write a bag of the messages that `change(topic, message, time)` returns, (topic, message, time) or None."""
    with rosbag.Bag(str(source)) as old, rosbag.Bag(str(target), 'w', compression='lz4') as new:
        for entry in old.read_messages():
            changed = change(*entry)
            if changed is not None:
                new.write(*changed)
    return str(target)
