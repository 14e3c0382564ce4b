import numpy as np
import pytest
import rosbag
from std_msgs.msg import Header
from tf2_msgs.msg import TFMessage

from ros_3d_bb.bags.bag_pipeline import process_bag
from ros_3d_bb.bags.bag_reader import BagError
from ros_3d_bb.bags.bag_writer import write_bag
from ros_3d_bb.bags.process_bag import main, with_params
from ros_3d_bb.camera.camera_model import Camera, transform_from
from ros_3d_bb.camera.images import DepthImage
from ros_3d_bb.conversions.camera_msgs import (DEPTH_TOPICS, START_NS, STATIC_TOPIC, CameraFrame, image_messages_of,
                                               transform_messages)
from ros_3d_bb.conversions.perception_msgs import (BOXES3D_TOPIC, BOXES_TOPIC, TRACKS_TOPIC, boxes2d_to_msg, stamp_of,
                                                   time_from, tracks_from_msg, usable_boxes3d)
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.nodes.bbox3d_node import Bbox3dNode
from ros_3d_bb.nodes.detector_node import DetectorNode
from ros_3d_bb.nodes.tracker_node import TrackerNode
from ros_3d_bb.pipeline.people_pipeline import Settings
from ros_3d_bb_lab.evaluation.clear_mot import Moment, score
from ros_3d_bb_lab.evaluation.defaults import SIMULATED_ERROR_MODEL, scenario_path
from ros_3d_bb_lab.evaluation.demo.scene_report import panels_of, read_recording
from ros_3d_bb_lab.simulation.ros.scenario_to_bag import TRUTH_TOPIC, scenario_images, simulated_messages
from ros_3d_bb_lab.simulation.scenario import read_scenario, scenario_from
from ros_3d_bb_lab.simulation.simulator import D435I_COLOR, Simulator
from support.bags import changed_bag, messages_in, scene_bag
from support.masterless import published
from support.two_cameras import Rig

LABELS = ['chair', 'dog', 'person', 'trolley']
pytestmark = pytest.mark.slow  # each scene is rendered and processed


@pytest.fixture(scope='module')
def run(tmp_path_factory):
    """[(truth, 3D boxes, tracks)] of the first 3 s of config/scenarios/objects.yaml."""
    source, target = (str(tmp_path_factory.mktemp('bags') / name) for name in ('in.bag', 'out.bag'))
    scenario = read_scenario(scenario_path('objects'))._replace(duration=3.0)
    write_bag(scenario_images(scenario, with_boxes=True), source)
    process_bag(source, target, with_params(Settings(detector='none'), 'bbox3d', error_model=SIMULATED_ERROR_MODEL))
    found = messages_in(target)
    return list(zip(*(found['/' + topic] for topic in (TRUTH_TOPIC, BOXES3D_TOPIC, TRACKS_TOPIC))))


def test_each_object_is_one_track_with_its_label(run):
    moments = [Moment(truth.header.stamp.to_nsec(), tracks_from_msg(truth), tracks_from_msg(tracks))
               for truth, _boxes3d, tracks in run]
    labels = {track.id: track.label for track in moments[0].truth}
    scores = score(moments)
    assert sorted(labels.values()) == LABELS and scores.false_share == 0
    published = {(track.id, track.label) for moment in moments for track in moment.tracks}
    assert sorted(label for _id, label in published) == LABELS  # one track each, whose label never changes
    for found in scores.people:
        assert (found.ids[0], labels[found.person]) in published and len(found.ids) == 1
        assert found.detected > 0.9 and found.rmse_m <= 0.08, labels[found.person]


def test_tracks_name_the_box_that_they_were_detected_as(run):
    detected = 0
    for _truth, boxes3d, tracks in run:
        assert boxes3d.header.stamp == tracks.header.stamp
        boxes, _faults = usable_boxes3d(boxes3d)
        indices = [track.detection for track in tracks.objects if track.detection >= 0]
        assert len(set(indices)) == len(indices)
        for track in tracks.objects:
            assert (track.detection >= 0) == (track.last_seen == tracks.header.stamp)
            if track.detection >= 0:
                assert boxes[track.detection].label == track.label
                detected += 1
    assert detected > 0.9 * 4 * len(run)


def test_objects_have_the_size_of_their_class(run):
    heights_m = {track.label: track.size.z for track in run[-1][2].objects}
    truth_m = {track.label: track.size.z for track in run[-1][0].objects}
    assert all(abs(heights_m[label] - truth_m[label]) < 0.15 for label in LABELS), heights_m
    assert all(track.size.x < 0.8 and track.score == 1.0 for track in run[-1][2].objects)


# A person walks from the view of the front camera into that of the left one; another one stands in both views.
SCENE = {'duration': 3.2, 'rate': 6.0, 'robot': {'cameras': [{'name': 'front'}, {'name': 'left', 'yaw': 0.6}]},
         'people': [{'start': [3.0, -0.2], 'moves': [{'to': [2.4, 2.2], 'speed': 0.9}]}, {'start': [4.6, 1.4]}]}
BOTH = with_params(Settings(detector='none'), 'tracker', cameras=['front', 'left'])


@pytest.fixture(scope='module')
def bags(tmp_path_factory):
    """A bag of the scene with its 2D boxes, and the output of process_bag."""
    folder = tmp_path_factory.mktemp('bags')
    path = scene_bag(folder / 'in.bag', SCENE, with_boxes=True)
    process_bag(path, str(folder / 'out.bag'), BOTH)
    return path, str(folder / 'out.bag')


def test_each_person_is_one_track_in_both_views(bags):
    with rosbag.Bag(bags[1]) as bag:
        recording = read_recording(bag)
        assert len(panels_of(bag, recording)) == 6  # the report shows images of both
    assert (len(recording.moments), recording.answered) == (39, 38)  # no tracks until both cameras have sent boxes
    result = score(recording.moments, recording.cameras)
    for person in result.people:
        assert person.visible_s > 2.5, person  # the first one in every second image
        assert len(person.ids) == 1 and person.rmse_m < 0.25, person
    assert result.false_share == 0
    last = recording.moments[-1]
    assert len(last.tracks) == len(last.truth) == 2


def test_boxes_are_in_the_namespaces_and_people_on_one_topic(bags):
    found = messages_in(bags[1])
    frames = {camera: set(message.header.frame_id for message in found['/%s/ros_3d_bb/bb_3d' % camera])
              for camera in ('front', 'left')}
    assert frames == {'front': {'front_color_optical_frame'}, 'left': {'left_color_optical_frame'}}
    stamps = [stamp_of(message) for message in found['/ros_3d_bb/tracks']]
    assert len(stamps) == 38 and stamps == sorted(stamps) and '/ros_3d_bb/bb_3d' not in found


def test_a_camera_missing_in_a_bag_is_named(bags, tmp_path):
    with pytest.raises(BagError, match='no std_msgs/Int32MultiArray on /rear/yolo_bounding_box; did you mean'):
        process_bag(bags[0], str(tmp_path / 'out.bag'), with_params(BOTH, 'tracker', cameras=['front', 'rear']))


@pytest.mark.parametrize('params,complaint', [
    ({'cameras': ['front', 'front']}, 'different namespaces expected'),
    ({'cameras': ['front camera']}, 'different namespaces expected'), ({'cameras': [1]}, 'different namespaces'),
    ({'cameras': ['front', 'rear'], 'camera_frame': 'mount'}, 'expected with a single camera only')])
def test_inconsistent_parameters_are_rejected(params, complaint):
    with pytest.raises(ValueError, match=complaint):
        Rig(*params.pop('cameras'), **params)


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
    color_from_depth = transform_from((-BASELINE_M, 0, 0), (0, 0, 0, 1))
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
