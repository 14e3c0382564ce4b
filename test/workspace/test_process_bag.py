import filecmp
import os
import signal
import subprocess

import genpy.dynamic
import numpy as np
import pytest
import rosbag
from tf2_msgs.msg import TFMessage

from ros_3d_bb.bags.bag_pipeline import process_bag
from ros_3d_bb.bags.bag_reader import BagError, BagReader
from ros_3d_bb.bags.bag_writer import write_bag
from ros_3d_bb.bags.process_bag import main, with_params
from ros_3d_bb.conversions.perception_msgs import boxes2d_from_msg, time_from, tracks_from_msg
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.pipeline.people_pipeline import Settings
from ros_3d_bb.sessions.session_reader import read_session
from support.bags import changed_bag, messages_in, scene_bag, session_images
from support.commands import run
from support.ros import wait_until

SCENE = {'duration': 1.5, 'rate': 10.0, 'people': [{'start': [3.0, 0.5], 'moves': [{'to': [3.0, -1.0]}]},
                                                   {'start': [4.0, -0.8]}]}
DEPTH = Settings(detector='depth')


@pytest.fixture(scope='module')
def scene(tmp_path_factory):
    return scene_bag(tmp_path_factory.mktemp('scene') / 'scene.bag', SCENE)


@pytest.fixture
def session_bag(session_folder, tmp_path):
    """Writes `in.bag`, a bag of five images of a session, with or without boxes."""
    session = read_session(session_folder)
    session = session._replace(frames=session.frames[:5])
    return lambda with_boxes: write_bag(session_images(session, with_boxes=with_boxes), str(tmp_path / 'in.bag'))


def run_tool(*arguments):
    status, printed = run(main, *arguments)
    assert not status, printed
    return printed


def test_people_are_tracked_and_the_input_is_kept(scene, tmp_path):
    events = process_bag(scene, str(tmp_path / 'out.bag'), DEPTH)
    before, after = messages_in(scene), messages_in(tmp_path / 'out.bag')
    assert {topic: after[topic] for topic in before} == before
    assert set(after) - set(before) == {'/yolo_bounding_box', '/ros_3d_bb/bb_3d', '/ros_3d_bb/tracks',
                                        '/visualization_marker_array'}
    assert events.counts['images processed'] == events.counts['images tracked'] == len(after['/ros_3d_bb/tracks']) == 15
    assert not events.sentences
    truth = {message.header.stamp: tracks_from_msg(message) for message in before['/ground_truth']}
    last = after['/ros_3d_bb/tracks'][-1]
    found = tracks_from_msg(last)
    assert len(found) == 2
    for person in truth[last.header.stamp]:
        assert min(np.linalg.norm(track.position_m[:2] - person.position_m[:2]) for track in found) < 0.3


def test_equal_bags_give_the_same_bytes(scene, tmp_path):
    subprocess.check_call(['rosrun', 'ros_3d_bb', 'process_bag', scene, str(tmp_path / 'tool.bag'), '--detector',
                           'depth'])
    process_bag(scene, str(tmp_path / 'alone.bag'), DEPTH)
    assert filecmp.cmp(str(tmp_path / 'alone.bag'), str(tmp_path / 'tool.bag'), shallow=False)


def test_the_number_of_parallel_searches_does_not_matter(session_bag, weights, tmp_path):
    session_bag(False)
    for searches in (1, 3):
        process_bag(str(tmp_path / 'in.bag'), str(tmp_path / ('%d.bag' % searches)),
                    with_params(Settings(searches=searches), 'detection', weights=weights))
    assert filecmp.cmp(str(tmp_path / '1.bag'), str(tmp_path / '3.bag'), shallow=False)
    found = messages_in(tmp_path / '1.bag')
    assert len(found['/yolo_bounding_box']) == len(found['/ros_3d_bb/bb_3d']) == 5
    boxes3d = [box for message in found['/ros_3d_bb/bb_3d'] for box in message.boxes]
    assert boxes3d and {box.label for box in boxes3d} == {'person'} and all(box.score > 0.25 for box in boxes3d)


def test_without_detector_the_boxes_in_the_bag_are_used(session_bag, tmp_path):
    session_bag(True)
    process_bag(str(tmp_path / 'in.bag'), str(tmp_path / 'out.bag'),
                Settings(detector='none', keep=('yolo_bounding_box',)))
    found = messages_in(tmp_path / 'out.bag')
    assert set(found) == {'/yolo_bounding_box', '/ros_3d_bb/bb_3d', '/ros_3d_bb/tracks', '/visualization_marker_array'}
    for boxes2d, boxes3d in zip(found['/yolo_bounding_box'], found['/ros_3d_bb/bb_3d']):
        assert boxes3d.header.stamp.to_nsec() == boxes2d_from_msg(boxes2d).stamp_ns
        assert len(boxes3d.boxes) == len(boxes2d.data) // 4


def test_topics_can_be_remapped_and_a_missing_one_is_named(scene, tmp_path):
    renamed = changed_bag(scene, tmp_path / 'in.bag', lambda topic, *rest: (
        topic.replace('/camera/', '/front/'),) + rest)
    with pytest.raises(BagError, match='did you mean /front/color/image_raw'):
        process_bag(renamed, str(tmp_path / 'out.bag'), DEPTH)
    remaps = ['%s:=%s' % (name, name.replace('camera/', 'front/')) for name in (
        'camera/color/image_raw', 'camera/aligned_depth_to_color/image_raw', 'camera/color/camera_info')]
    options = [part for remap in remaps for part in ('--remap', remap)] + ['--remap', 'ros_3d_bb/tracks:=people']
    run_tool(renamed, tmp_path / 'out.bag', '--detector', 'depth', *options)
    assert len(messages_in(tmp_path / 'out.bag')['/people']) == 15


def test_without_transforms_the_summary_names_the_cause(scene, tmp_path):
    changed_bag(scene, tmp_path / 'in.bag', lambda topic, *rest: None if topic == '/tf' else (topic,) + rest)
    status, printed = run(main, tmp_path / 'in.bag', tmp_path / 'out.bag', '--detector', 'depth')
    assert status == 1 and '15  no transform' in printed
    assert printed.splitlines()[-1].startswith('no tracks: no transform from camera_color_optical_frame to map')
    found = messages_in(tmp_path / 'out.bag')
    assert '/ros_3d_bb/tracks' not in found and len(found['/ros_3d_bb/bb_3d']) == 15


def test_transforms_may_be_later_than_the_image_by_tf_timeout(scene, tmp_path):
    """A tenth of a second is within tf_timeout; half a second is not."""
    for delay_ns, is_known in ((NS // 10, True), (NS // 2, False)):
        changed_bag(scene, tmp_path / 'in.bag', lambda topic, message, time: (
            topic, message, time_from(time.to_nsec() + (delay_ns if topic == '/tf' else 0))))
        events = process_bag(str(tmp_path / 'in.bag'), str(tmp_path / 'out.bag'), DEPTH)
        assert ('no transform' not in events.counts) == is_known


def test_transforms_of_old_bags_are_used(scene, tmp_path):
    old = type('tfMessage', (TFMessage,), {'_type': 'tf/tfMessage'})
    path = changed_bag(scene, tmp_path / 'in.bag', lambda topic, message, time: (
        topic, old(message.transforms) if topic == '/tf' else message, time))
    assert BagReader(path).topics['/tf'] == 'tf/tfMessage'
    events = process_bag(path, str(tmp_path / 'out.bag'), DEPTH)
    assert not {'no transform', 'transforms rejected'} & set(events.counts) and events.counts['images with tracks']


def test_an_output_that_cannot_be_written_is_named_before_the_work(scene, tmp_path, monkeypatch):
    monkeypatch.setattr('ros_3d_bb.bags.bag_pipeline.BagRun.outputs', lambda _run: pytest.fail('it began'))
    (tmp_path / 'folder').mkdir()
    for target in (tmp_path / 'folder', tmp_path / 'missing' / 'out.bag'):
        status, printed = run(main, scene, target, '--detector', 'depth')
        assert status == 1 and str(target) in printed
    assert os.listdir(str(tmp_path)) == ['folder']


@pytest.mark.slow
@pytest.mark.parametrize('number', [signal.SIGTERM, signal.SIGHUP])
def test_a_signal_leaves_no_incomplete_bag(scene, tmp_path, number):
    command = subprocess.Popen(['rosrun', 'ros_3d_bb', 'process_bag', scene, str(tmp_path / 'out.bag'), '--detector',
                                'depth'], preexec_fn=lambda: signal.signal(signal.SIGHUP, signal.SIG_DFL))
    wait_until(lambda: os.listdir(str(tmp_path)), 'an incomplete bag')
    os.kill(command.pid, number)
    assert command.wait(60) == 128 + number and os.listdir(str(tmp_path)) == []


def test_broken_bags_are_named(scene, tmp_path):
    with open(scene, 'rb') as stream:
        content = stream.read()
    middle = len(content) // 2
    contents = {'cut.bag': content[:middle], 'text.bag': b'#ROSBAG V2.0\nsome text', 'empty.bag': b'',
                'flipped.bag': content[:middle] + os.urandom(2 ** 20) + content[middle + 2 ** 20:]}
    for name, changed in contents.items():
        (tmp_path / name).write_bytes(changed)
    for name in list(contents) + ['missing.bag']:
        status, printed = run(main, tmp_path / name, tmp_path / 'out.bag', '--detector', 'depth')
        assert status == 1 and str(tmp_path / name) in printed
    assert sorted(os.listdir(str(tmp_path))) == sorted(contents)


@pytest.mark.parametrize('arguments,complaint', [
    ('a.bag', 'required: OUT'), ('a.bag a.bag --detector depth', 'also the input'),
    ('a.bag b.bag', '~weights: --weights'),
    ('a.bag b.bag --detector depth --remap x', 'TOPIC_OF_THE_NODES:='),
    ('a.bag b.bag --detector depth --remap camera/colour/image_raw:=x', 'did you mean camera/color/image_raw?'),
    ('a.bag b.bag --detector depth --cameras left,right --remap camera/color/image_raw:=x', 'the nodes have no topic'),
    ('a.bag b.bag --detector depth --depth raw --remap camera/aligned_depth_to_color/image_raw:=x', '--remap')])
def test_invalid_arguments_are_rejected(tmp_path, monkeypatch, arguments, complaint):
    monkeypatch.chdir(str(tmp_path))
    status, printed = run(main, *arguments.split())
    assert status == 2 and complaint in printed and os.listdir(str(tmp_path)) == []


@pytest.mark.parametrize('text,complaint', [('target_frme: odom', 'did you mean ~target_frame'),
                                            ('- 1', 'names and values')])
def test_parameter_files_are_checked(tmp_path, text, complaint):
    (tmp_path / 'tracker.yaml').write_text(text + '\n')
    status, printed = run(main, 'a.bag', 'b.bag', '--detector', 'depth', '--tracker-params', tmp_path / 'tracker.yaml')
    assert status == 2 and complaint in printed and 'error: --tracker-params: ' in printed


def test_parameter_files_of_the_nodes_are_used(scene, tmp_path):
    config = os.path.join(os.path.dirname(__file__), '..', '..', 'config')
    (tmp_path / 'tracker.yaml').write_text('max_age: 2.0\ntarget_frame: odom\n')
    run_tool(scene, tmp_path / 'out.bag', '--detector', 'depth', '--tracker-params', tmp_path / 'tracker.yaml',
             '--bbox3d-params', os.path.join(config, 'bbox3d.yaml'),
             '--detector-params', os.path.join(config, 'depth.yaml'))
    assert messages_in(tmp_path / 'out.bag')['/ros_3d_bb/tracks'][-1].header.frame_id == 'odom'


def test_no_code_is_generated_from_the_definitions_in_a_bag(tmp_path, monkeypatch):
    """rosbag would generate and import Python code."""
    with rosbag.Bag(str(tmp_path / 'in.bag'), 'w') as bag:
        unused = type('Unused', (), {'_md5sum': '0' * 32})
        header = {'topic': '/a', 'type': 'a/B', 'md5sum': '0' * 32, 'message_definition': 'int32 x'}
        bag.write('/a', ('a/B', b'1234', '0' * 32, unused), time_from(1), raw=True, connection_header=header)
    generated = []
    monkeypatch.setattr(genpy.dynamic, 'generate_dynamic', lambda *arguments: generated.append(arguments))
    with BagReader(str(tmp_path / 'in.bag')) as reader:
        assert [raw.data for raw in reader.messages()] == [b'1234']
    assert not generated
