import numpy as np
import pytest
from std_msgs.msg import Header
from tf2_msgs.msg import TFMessage

from ros_3d_bb.bags.bag_pipeline import process_bag
from ros_3d_bb.bags.bag_writer import write_bag
from ros_3d_bb.bags.process_bag import main, with_params
from ros_3d_bb.camera.camera_model import Camera
from ros_3d_bb.camera.images import DepthImage
from ros_3d_bb.conversions.camera_msgs import (DEPTH_TOPICS, START_NS, STATIC_TOPIC, CameraFrame, image_messages_of,
                                               transform_messages)
from ros_3d_bb.conversions.perception_msgs import BOXES3D_TOPIC, BOXES_TOPIC, TRACKS_TOPIC, boxes2d_to_msg, time_from
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.nodes.bbox3d_node import Bbox3dNode
from ros_3d_bb.nodes.detector_node import DetectorNode
from ros_3d_bb.nodes.tracker_node import TrackerNode
from ros_3d_bb.pipeline.people_pipeline import Settings
from ros_3d_bb_lab.simulation.ros.scenario_to_bag import simulated_messages
from ros_3d_bb_lab.simulation.scenario import scenario_from
from ros_3d_bb_lab.simulation.simulator import D435I_COLOR, Simulator
from support.bags import changed_bag, messages_in
from support.masterless import published

IMAGES, COLOR_FRAME, DEPTH_FRAME = 5, 'camera_color_optical_frame', 'camera_depth_optical_frame'
DEPTH_CAMERA = Camera(848, 480, 421.0, 421.0, 424.2, 238.9)
MOUNT_M = (0.17, 0.0, 0.20)
BASELINE_M = 0.05  # between the cameras
PEOPLE = [{'start': [2.2, 0.5], 'facing': 3.1}, {'start': [3.2, -0.9], 'moves': [{'to': [3.2, -0.3]}]},
          {'start': [5.0, -0.2], 'facing': 1.0}]
RAW_INFO_TOPIC = DEPTH_TOPICS['raw'][1]


def simulator(beside_m, camera):
    """The scene as seen by a camera to the left of the colour camera."""
    mount_m = [MOUNT_M[0], MOUNT_M[1] + beside_m, MOUNT_M[2]]
    content = {'duration': 1.0, 'rate': float(IMAGES), 'depth_noise': False, 'people': PEOPLE,
               'robot': {'mount': mount_m}}
    return Simulator(scenario_from(content), camera)


def images(color, depth):
    """The messages of a driver that aligns depth and publishes raw depth beside it, with true 2D boxes."""
    color_from_depth = np.linalg.inv(color.poses_at(0).map_from_camera).dot(depth.poses_at(0).map_from_camera)
    assert np.allclose(color_from_depth[:3, 3], (-BASELINE_M, 0, 0))
    for number in range(IMAGES):
        frame, beside = color.frame(number), depth.frame(number)
        stamp_ns = START_NS + number * NS // IMAGES
        header = Header(stamp=time_from(stamp_ns), frame_id=DEPTH_FRAME)
        messages = simulated_messages(color, frame, stamp_ns)
        raw = dict(image_messages_of(CameraFrame(header, DEPTH_CAMERA, beside.color,
                                                 DepthImage(beside.depth_mm, 0.001), ())))
        for ours, theirs in zip(*map(DEPTH_TOPICS.get, ('aligned', 'raw'))):
            messages.insert(0, (theirs, raw[ours]))  # camera_info first
        boxes_px = [person.box_px for person in frame.people]
        messages.append((BOXES_TOPIC, boxes2d_to_msg(np.array(boxes_px), header)))
        if number == 0:
            link = COLOR_FRAME, DEPTH_FRAME, color_from_depth
            messages.insert(0, (STATIC_TOPIC, TFMessage(transform_messages(header.stamp, [link]))))
        yield stamp_ns, messages


@pytest.fixture(scope='module')
def bag(tmp_path_factory):
    path = str(tmp_path_factory.mktemp('raw') / 'in.bag')
    write_bag(images(simulator(0.0, D435I_COLOR), simulator(BASELINE_M, DEPTH_CAMERA)), path)
    return path


def boxes_in(path):
    """The messages on ros_3d_bb/bb_3d, and the centres of their boxes, (n, 3)."""
    messages = messages_in(path, '/ros_3d_bb/bb_3d')['/ros_3d_bb/bb_3d']
    centers = [box.center.position for message in messages for box in message.boxes]
    return messages, np.array([(center.x, center.y, center.z) for center in centers])


def settings(depth='raw', detector='none'):
    made = Settings(detector=detector)
    for node in ('detection', 'bbox3d', 'tracker'):
        made = with_params(made, node, depth=depth)
    return made


def test_boxes_from_raw_depth_equal_those_from_aligned_depth(bag, tmp_path):
    plain = process_bag(bag, str(tmp_path / 'plain.bag'), settings('aligned'))
    with pytest.raises(SystemExit) as ended:
        main([bag, str(tmp_path / 'raw.bag'), '--detector', 'none', '--depth', 'raw'])
    assert not ended.value.code and not plain.sentences
    _messages, expected_m = boxes_in(tmp_path / 'plain.bag')
    messages, found_m = boxes_in(tmp_path / 'raw.bag')
    assert len(messages) == IMAGES and {message.header.frame_id for message in messages} == {COLOR_FRAME}
    assert found_m.shape == expected_m.shape == (IMAGES * len(PEOPLE), 3)
    assert np.linalg.norm(found_m - expected_m, axis=1).max() < 0.01


def test_the_nodes_publish_the_same(bag, tmp_path):
    """And the detector finds the people in both kinds of depth."""
    counts = {}
    for depth in ('aligned', 'raw'):
        process_bag(bag, str(tmp_path / depth), settings(depth, 'depth'))
        counts[depth] = [len(message.boxes) for message in boxes_in(tmp_path / depth)[0]]
    assert counts['raw'] == counts['aligned'] and sum(counts['raw']) > IMAGES
    for node_class, params, topic in ((DetectorNode, {'detector': 'depth'}, BOXES_TOPIC),
                                      (Bbox3dNode, {}, BOXES3D_TOPIC),
                                      (TrackerNode, {'tf_timeout': 0.0}, TRACKS_TOPIC)):
        found = published(node_class, str(tmp_path / 'raw'), dict(params, depth='raw'), [topic])
        expected = messages_in(tmp_path / 'raw', '/' + topic)['/' + topic]
        if node_class is Bbox3dNode:  # has no colour image in a process of its own
            for box in [box for message in expected for box in message.boxes]:
                box.appearance = []
        assert len(expected) == IMAGES and [str(message) for message in found[topic]] == list(map(str, expected))


@pytest.mark.parametrize('unwanted,named', [(STATIC_TOPIC, (COLOR_FRAME, DEPTH_FRAME)),
                                            (RAW_INFO_TOPIC, ('/' + RAW_INFO_TOPIC,))])
def test_what_registration_needs_is_named_if_it_is_missing(bag, tmp_path, unwanted, named):
    changed_bag(bag, tmp_path / 'in.bag', lambda topic, *rest: None if topic == '/' + unwanted else (topic,) + rest)
    events = process_bag(str(tmp_path / 'in.bag'), str(tmp_path / 'out.bag'), settings())
    assert events.counts['2D boxes rejected'] == IMAGES
    assert all(name in events.sentences['2D boxes rejected'] for name in named)
