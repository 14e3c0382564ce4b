"""ROS messages of simulated scenes, and the command `scenario_to_bag`."""
import argparse
import itertools
import sys

import numpy as np
from std_msgs.msg import Header

from ros_3d_bb.bags.bag_writer import write_bag
from ros_3d_bb.camera.images import DepthImage
from ros_3d_bb.conversions.camera_msgs import START_NS, TF_TOPIC, CameraFrame, frame_id_of, messages_of, topic_of
from ros_3d_bb.conversions.perception_msgs import BOXES_TOPIC, boxes2d_to_msg, time_from, tracks_to_msg
from ros_3d_bb.core.atomic_file import clean_up_on_sigterm
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb_lab.simulation.scenario import read_scenario, with_overrides
from ros_3d_bb_lab.simulation.simulator import Simulator

TRUTH_TOPIC = 'ground_truth'
MAP_FRAME, ODOM_FRAME, BASE_FRAME = 'map', 'odom', 'base_link'


def transforms_of(poses, camera_name):
    """Links (parent, child, parent_from_child (4, 4)) from the map to a camera, given by its name, for `Poses`."""
    return [(MAP_FRAME, ODOM_FRAME, poses.map_from_odom), (ODOM_FRAME, BASE_FRAME, poses.odom_from_base),
            (BASE_FRAME, frame_id_of(camera_name), poses.base_from_camera)]


def simulated_messages(simulator, frame, stamp_ns):
    """Convert a frame to (topic, message) pairs: tf, camera_info, depth, colour, and ground truth in the map.

    The occlusion status in the ground truth refers to the camera of the frame.
    """
    stamp, frame_id = time_from(stamp_ns), frame_id_of(frame.camera_name)
    taken = CameraFrame(Header(stamp=stamp, frame_id=frame_id), simulator.camera, frame.color,
                        DepthImage(frame.depth_mm, 0.001), transforms_of(frame.poses, frame.camera_name))
    messages = [(topic_of(frame.camera_name, topic) if topic != TF_TOPIC else topic, message)
                for topic, message in messages_of(taken)]
    truth = tracks_to_msg(simulator.true_tracks(frame, stamp_ns), Header(stamp=stamp, frame_id=MAP_FRAME))
    return messages + [(TRUTH_TOPIC, truth)]


def boxes_message(frame, boxes, stamp_ns, labels):
    """Topic and message of 2D boxes (n, 4), integers, with class names, of a frame."""
    header = Header(stamp=time_from(stamp_ns), frame_id=frame_id_of(frame.camera_name))
    return topic_of(frame.camera_name, BOXES_TOPIC), boxes2d_to_msg(boxes, header, labels, [1.0] * len(boxes))


def scenario_images(scenario, with_boxes=False):
    """Yield the messages of each image of a scenario for `write_bag`, with ground truth and optionally 2D boxes."""
    simulator = Simulator(scenario)
    for number in range(simulator.frame_count):
        frame = simulator.frame(number)
        stamp_ns = START_NS + int(round(frame.time_s * NS))
        messages = simulated_messages(simulator, frame, stamp_ns)
        if with_boxes:
            shown = [truth for truth in frame.truth if truth.box_px is not None]
            boxes = np.array([truth.box_px for truth in shown], int).reshape(-1, 4)
            messages.append(boxes_message(frame, boxes, stamp_ns, [truth.label for truth in shown]))
        yield stamp_ns, messages


def scenario_to_bag():
    parser = argparse.ArgumentParser(prog='scenario_to_bag',
                                     description='Render a scenario to a bag with ground truth.')
    parser.add_argument('--compression', choices=('none', 'bz2', 'lz4'), default='lz4', help='default: lz4')
    parser.add_argument('scenario', help='scenario file (YAML), see config/scenarios')
    parser.add_argument('bag', help='bag to write')
    parser.add_argument('--rate', type=float, metavar='HZ', help="images per second (default: the scenario's)")
    parser.add_argument('--seed', type=int, help="seed of noise and people's appearance (default: the scenario's)")
    parser.add_argument('--images', type=int, metavar='N', help='number of images, from the start (default: all)')
    parser.add_argument('--boxes', action='store_true', help='also write the true 2D boxes to yolo_bounding_box')
    arguments = parser.parse_args()
    if arguments.images is not None and arguments.images < 1:
        parser.error('--images %d: at least 1 expected' % arguments.images)
    clean_up_on_sigterm()
    try:
        scenario = with_overrides(read_scenario(arguments.scenario), arguments.rate, arguments.seed)
        images = itertools.islice(scenario_images(scenario, arguments.boxes), arguments.images)
        count = write_bag(images, arguments.bag, arguments.compression)
    except (ValueError, OSError) as error:
        print('scenario_to_bag: %s; no bag was written' % error, file=sys.stderr)
        sys.exit(1)
    print('%s: %d images' % (arguments.bag, count))
