"""Content of bags, bags of simulated scenes, and bags with changed messages."""
import numpy as np
import rosbag
from std_msgs.msg import Header

from ros_3d_bb.bags.bag_writer import write_bag
from ros_3d_bb.camera.camera_model import OPTICAL_ROTATION, transform_from
from ros_3d_bb.conversions.camera_msgs import START_NS, CameraFrame, messages_of
from ros_3d_bb.conversions.perception_msgs import BOXES_TOPIC, boxes2d_to_msg, time_from
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.sessions.session_reader import read_color, read_depth
from ros_3d_bb_lab.simulation.ros.scenario_to_bag import scenario_images
from ros_3d_bb_lab.simulation.scenario import scenario_from

MOUNT_M = (0.17, 0.0, 0.20)  # position of the camera of a Jackal in base_link: forward, left, up (thesis 3.5.1)


def messages_in(path, *topics):
    """{topic: messages} of a bag, by default of all topics."""
    by_topic = {}
    with rosbag.Bag(str(path)) as bag:
        for topic, message, _time in bag.read_messages(topics or None):
            by_topic.setdefault(topic, []).append(message)
    return by_topic


def scene_bag(path, scene, with_boxes=False):
    write_bag(scenario_images(scenario_from(scene), with_boxes), str(path))
    return str(path)


def session_images(session, rate_hz=30.0, with_boxes=False):
    """Yield the images of a measurement session for `write_bag`, optionally with their 2D boxes."""
    for number, frame in enumerate(session.frames):
        base_from_camera = transform_from(MOUNT_M, OPTICAL_ROTATION)
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


def changed_bag(source, target, change):
    """Write a bag of the messages that `change(topic, message, time)` returns, (topic, message, time) or None."""
    with rosbag.Bag(str(source)) as old, rosbag.Bag(str(target), 'w', compression='lz4') as new:
        for entry in old.read_messages():
            changed = change(*entry)
            if changed is not None:
                new.write(*changed)
    return str(target)
