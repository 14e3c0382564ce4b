"""Bags of a simulated scene with one fault each, as drivers and recordings have them.

Each fault is a function of (topic, message, time) for `bags.changed_bag`.
"""
import copy

import numpy as np
import rospy

from ros_3d_bb.camera.camera_model import transform_from
from ros_3d_bb.conversions.camera_msgs import transform_messages
from ros_3d_bb.conversions.image_msgs import fill_image, imgmsg_to_depth

COLOR, INFO = '/camera/color/image_raw', '/camera/color/camera_info'
DEPTH, DEPTH_INFO = '/camera/aligned_depth_to_color/image_raw', '/camera/aligned_depth_to_color/camera_info'
IMAGES, INFOS = (COLOR, DEPTH, INFO, DEPTH_INFO), (INFO, DEPTH_INFO)
TRUTH, BOXES = '/ground_truth', '/yolo_bounding_box'
OPTICAL = 'camera_color_optical_frame'


def whole(topic, message, time):
    return topic, message, time


def of_another_driver(topic, message, time):
    return (topic.replace('/camera/color', '/cam0/rgb').replace('/camera/aligned_depth_to_color', '/cam0/depth_to_rgb'),
            message, time)


def without(*topics):
    return lambda topic, message, time: None if topic in topics else (topic, message, time)


def each(topics, change):
    """Apply `change(message)` to a copy of the messages on some topics."""
    def changed(topic, message, time):
        if topic in topics:
            message = copy.deepcopy(message)
            change(message)
        return topic, message, time
    return changed


def with_matrix(message, factor):
    message.K = [value * factor for value in message.K[:8]] + [1.0]
    message.P = [value * factor for value in message.P[:10]] + [1.0, 0.0]


def delayed(topics, by_s):
    return each(topics, lambda message: setattr(message.header, 'stamp', message.header.stamp + rospy.Duration(by_s)))


def tf_delayed(by_s):
    def change(message):
        for link in message.transforms:
            link.header.stamp += rospy.Duration(by_s)
    return each(['/tf'], change)


def with_unit(per_mm):
    return each([DEPTH], lambda message: fill_image(
        message, (imgmsg_to_depth(message).values * per_mm).astype(np.uint16), '16UC1'))


def in_frame(frame_id):
    return each(IMAGES, lambda message: setattr(message.header, 'frame_id', frame_id))


def with_frames(names):
    def changed(topic, message, time):
        message = copy.deepcopy(message)
        if topic == '/tf':
            for link in message.transforms:
                link.header.frame_id = names.get(link.header.frame_id, link.header.frame_id)
                link.child_frame_id = names.get(link.child_frame_id, link.child_frame_id)
        elif topic in IMAGES + (TRUTH,):
            message.header.frame_id = names.get(message.header.frame_id, message.header.frame_id)
        return topic, message, time
    return changed


def shifted(message):
    fill_image(message, np.roll(imgmsg_to_depth(message).values, 14, axis=1), '16UC1')


def in_the_frame_of_depth(topic, message, time):
    """Depth that is registered to colour but keeps the frame of the depth camera, 5 cm beside, as of an Astra."""
    message = copy.deepcopy(message)
    if topic in (DEPTH, DEPTH_INFO):
        message.header.frame_id = 'camera_depth_optical_frame'
    elif topic == '/tf':
        beside = transform_from((0.05, 0, 0), (0, 0, 0, 1))
        message.transforms += transform_messages(message.transforms[0].header.stamp, [
            (OPTICAL, 'camera_depth_optical_frame', beside)])
    return topic, message, time
