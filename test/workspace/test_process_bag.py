"""process_bag: what the nodes would publish, the same bytes each time, and broken bags are named."""
import bz2
import hashlib
import os
import resource
import stat
import struct
import subprocess

import genpy.dynamic
import numpy as np
import pytest
import rosbag
from geometry_msgs.msg import TransformStamped
from sensor_msgs.msg import Image
from tf2_msgs.msg import TFMessage

from ros_3d_bb.bags.bag_pipeline import process_bag
from ros_3d_bb.bags.bag_reader import BagError, BagReader
from ros_3d_bb.bags.bag_tf_buffer import BagTransforms
from ros_3d_bb.bags.bag_writer import SessionBagOptions, session_images, write_bag
from ros_3d_bb.conversions.camera_msgs import START_NS
from ros_3d_bb.conversions.perception_msgs import boxes2d_from_msg, time_from, tracks_from_msg
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.pipeline.detection_stage import Yolov5NodeParams
from ros_3d_bb.pipeline.offline_pipeline import Settings
from ros_3d_bb.sessions.session_reader import read_session
from ros_3d_bb_lab.simulation.ros.scenario_to_bag import scenario_images
from ros_3d_bb_lab.simulation.scenario import scenario_from

SCENE = {'duration': 1.5, 'rate': 10.0, 'people': [{'start': [3.0, 0.5], 'moves': [{'to': [3.0, -1.0]}]},
                                                   {'start': [4.0, -0.8]}]}
DEPTH = Settings(detector='depth')


@pytest.fixture(scope='module')
def scene(tmp_path_factory):
    """A bag of two people, one and a half seconds long."""
    path = str(tmp_path_factory.mktemp('scene') / 'scene.bag')
    write_bag(scenario_images(scenario_from(SCENE)), path)
    return path


def digest(path):
    with open(str(path), 'rb') as stream:
        return hashlib.sha256(stream.read()).hexdigest()


def messages_in(path):
    """{topic: messages}."""
    by_topic = {}
    with rosbag.Bag(str(path)) as bag:
        for topic, message, _time in bag.read_messages():
            by_topic.setdefault(topic, []).append(message)
    return by_topic


def rewritten(source, target, change):
    """A bag with what `change(topic, message, time)` makes of each message: (topic, message, time) or None."""
    with rosbag.Bag(str(source)) as old, rosbag.Bag(str(target), 'w', compression='lz4') as new:
        for entry in old.read_messages():
            changed = change(*entry)
            if changed is not None:
                new.write(*changed)
    return str(target)


def run_tool(*arguments):
    return subprocess.run(['rosrun', 'ros_3d_bb', 'process_bag'] + [str(argument) for argument in arguments],
                          stdout=subprocess.PIPE, stderr=subprocess.STDOUT, universal_newlines=True)


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


def test_twice_alone_and_beside_others_gives_the_same_bytes(scene, tmp_path):
    (tmp_path / 'others').mkdir()
    names = ['one.bag', 'two.bag']
    for name in names:
        os.symlink(scene, str(tmp_path / 'others' / name))
    result = run_tool(*[tmp_path / 'others' / name for name in names], '--out-dir', tmp_path / 'out', '--jobs', 2,
                      '--detector', 'depth')
    assert result.returncode == 0, result.stdout
    process_bag(scene, str(tmp_path / 'alone.bag'), DEPTH)
    results = [tmp_path / 'alone.bag'] + [tmp_path / 'out' / name for name in names]
    assert len(set(digest(path) for path in results)) == 1


def test_the_number_of_searches_at_once_does_not_matter(session_folder, weights, tmp_path):
    session = read_session(session_folder)
    session = session._replace(frames=session.frames[:6])
    write_bag(session_images(session), str(tmp_path / 'in.bag'))
    settings = Settings()._replace(yolov5=(Yolov5NodeParams(weights=weights),) + Settings().yolov5[1:])
    for searches in (1, 3):
        process_bag(str(tmp_path / 'in.bag'), str(tmp_path / ('%d.bag' % searches)),
                    settings._replace(searches=searches))
    assert digest(tmp_path / '1.bag') == digest(tmp_path / '3.bag')
    found = messages_in(tmp_path / '1.bag')
    assert len(found['/yolo_bounding_box']) == len(found['/ros_3d_bb/bb_3d']) == 6
    assert any(message.boxes for message in found['/ros_3d_bb/bb_3d'])


def test_boxes_in_the_bag_serve_where_no_detector_is_wanted(session_folder, tmp_path):
    session = read_session(session_folder)
    session = session._replace(frames=session.frames[:5])
    write_bag(session_images(session, SessionBagOptions(30.0, with_boxes=True)), str(tmp_path / 'in.bag'))
    process_bag(str(tmp_path / 'in.bag'), str(tmp_path / 'out.bag'),
                Settings(detector='none', keep=('yolo_bounding_box',)))
    found = messages_in(tmp_path / 'out.bag')
    assert set(found) == {'/yolo_bounding_box', '/ros_3d_bb/bb_3d', '/ros_3d_bb/tracks', '/visualization_marker_array'}
    for boxes2d, boxes3d in zip(found['/yolo_bounding_box'], found['/ros_3d_bb/bb_3d']):
        assert boxes3d.header.stamp.to_nsec() == boxes2d_from_msg(boxes2d).stamp_ns
        assert len(boxes3d.boxes) == len(boxes2d.data) // 4


def test_other_topics_are_named_and_results_go_beside_them(scene, tmp_path):
    renamed = rewritten(scene, tmp_path / 'in.bag', lambda topic, *rest: (topic.replace('/camera/', '/front/'),) + rest)
    with pytest.raises(BagError, match='did you mean /front/color/image_raw'):
        process_bag(renamed, str(tmp_path / 'out.bag'), DEPTH)
    remaps = ['%s:=%s' % (name, name.replace('camera/', 'front/')) for name in (
        'camera/color/image_raw', 'camera/aligned_depth_to_color/image_raw', 'camera/color/camera_info')]
    options = [part for remap in remaps for part in ('--remap', remap)] + ['--remap', 'ros_3d_bb/tracks:=people']
    result = run_tool(renamed, tmp_path / 'out.bag', '--detector', 'depth', *options)
    assert result.returncode == 0, result.stdout
    assert len(messages_in(tmp_path / 'out.bag')['/people']) == 15


def test_without_transforms_nobody_is_tracked_and_the_summary_says_so(scene, tmp_path):
    rewritten(scene, tmp_path / 'in.bag', lambda topic, *rest: None if topic == '/tf' else (topic,) + rest)
    result = run_tool(tmp_path / 'in.bag', tmp_path / 'out.bag', '--detector', 'depth')
    assert result.returncode == 0 and '15  no transform' in result.stdout
    assert 'no transform from camera_color_optical_frame to map' in result.stdout
    found = messages_in(tmp_path / 'out.bag')
    assert '/ros_3d_bb/tracks' not in found and len(found['/ros_3d_bb/bb_3d']) == 15


def test_without_depth_every_image_is_accounted_for(scene, tmp_path):
    rewritten(scene, tmp_path / 'in.bag', lambda topic, *rest: None if 'aligned' in topic else (topic,) + rest)
    events = process_bag(str(tmp_path / 'in.bag'), str(tmp_path / 'out.bag'), DEPTH)
    assert events.counts['colour images without depth'] == 15


def test_time_that_jumps_back_begins_anew_with_other_numbers(scene, tmp_path):
    """Stamps and transforms go back by 60 s halfway, as where a bag was recorded from one that was played twice."""
    half = START_NS + NS * 7 // 10

    def back(stamp):
        return time_from(stamp.to_nsec() - 60 * NS)

    def change(topic, message, time):
        if time.to_nsec() > half:
            for stamped in message.transforms if topic == '/tf' else [message]:
                stamped.header.stamp = back(stamped.header.stamp)
        return topic, message, time
    rewritten(scene, tmp_path / 'in.bag', change)
    events = process_bag(str(tmp_path / 'in.bag'), str(tmp_path / 'out.bag'), DEPTH)
    assert events.counts['jumps back in time'] == 1 and 'no transform' not in events.counts
    tracks = messages_in(tmp_path / 'out.bag')['/ros_3d_bb/tracks']
    assert len(tracks) == 15
    early, late = (set(track.id for message in tracks for track in message.objects
                       if (message.header.stamp.to_nsec() > START_NS) == is_early) for is_early in (True, False))
    assert early and late and not early & late


def test_transforms_that_come_later_than_the_image_are_waited_for(scene, tmp_path):
    """A tenth of a second is within tf_timeout; half a second is not."""
    for delay_ns, is_known in ((NS // 10, True), (NS // 2, False)):
        rewritten(scene, tmp_path / 'in.bag', lambda topic, message, time: (
            topic, message, time_from(time.to_nsec() + (delay_ns if topic == '/tf' else 0))))
        events = process_bag(str(tmp_path / 'in.bag'), str(tmp_path / 'out.bag'), DEPTH)
        assert ('no transform' not in events.counts) == is_known


def test_static_transforms_hold_after_a_jump():
    transforms = BagTransforms()

    def message(stamp_s, child):
        transform = TransformStamped(child_frame_id=child)
        transform.header.frame_id, transform.header.stamp = 'map', time_from(stamp_s * NS)
        transform.transform.rotation.w = 1.0
        return TFMessage([transform])
    transforms.set_static(message(0, 'mast'))
    for tf in (message(100, 'base'), message(5, 'base'), message(6, 'base')):
        transforms.ahead(tf)
        transforms.passed(tf)
    assert np.array_equal(transforms.lookup('map', 'base', time_from(11 * NS // 2)), np.eye(4))
    assert np.array_equal(transforms.lookup('map', 'mast', time_from(5 * NS)), np.eye(4))


@pytest.fixture(scope='module')
def broken_bags(scene, tmp_path_factory):
    """Bags that cannot be used."""
    folder = tmp_path_factory.mktemp('broken')
    with open(scene, 'rb') as stream:
        content = stream.read()
    middle = len(content) // 2
    contents = {'cut.bag': content[:middle], 'text.bag': b'#ROSBAG V2.0\nnothing of the kind', 'empty.bag': b'',
                'flipped.bag': content[:middle] + os.urandom(2 ** 20) + content[middle + 2 ** 20:]}
    for name, changed in contents.items():
        (folder / name).write_bytes(changed)
    return [folder / name for name in sorted(contents)] + [folder / 'missing.bag']


def test_broken_bags_are_named_and_the_others_go_on(scene, broken_bags, tmp_path):
    result = run_tool(*(broken_bags + [scene]), '--out-dir', tmp_path, '--detector', 'depth', '--jobs', 2)
    assert result.returncode == 1 and 'Traceback' not in result.stdout
    for path in broken_bags:
        assert any(str(path) in line and 'no bag was written' in line for line in result.stdout.splitlines()), path
    assert os.listdir(str(tmp_path)) == ['scene.bag']


@pytest.mark.parametrize('arguments,complaint', [
    (['a.bag'], 'IN and OUT'), (['a.bag', 'a.bag', '--detector', 'depth'], 'another place'),
    (['a.bag', 'b.bag'], 'needs --weights'),
    (['x/a.bag', 'y/a.bag', '--out-dir', 'z', '--detector', 'depth'], 'two bags'),
    (['a.bag', 'b.bag', '--detector', 'depth', '--remap', 'x'], 'TOPIC_OF_THE_NODES:=')])
def test_arguments_that_make_no_sense_are_refused(tmp_path, arguments, complaint):
    result = subprocess.run(['rosrun', 'ros_3d_bb', 'process_bag'] + arguments, cwd=str(tmp_path),
                            stdout=subprocess.PIPE, stderr=subprocess.STDOUT, universal_newlines=True)
    assert result.returncode == 2 and complaint in result.stdout and os.listdir(str(tmp_path)) == []


@pytest.mark.parametrize('text,complaint', [('target_frme: odom', 'did you mean ~target_frame'),
                                            ('target_frame: [1]', 'str expected'), ('- 1', 'names and values'),
                                            ('!!python/object/apply:os.system ["true"]', 'could not determine')])
def test_parameter_files_are_checked(scene, tmp_path, text, complaint):
    (tmp_path / 'tracker.yaml').write_text(text + '\n')
    result = run_tool(scene, tmp_path / 'out.bag', '--detector', 'depth', '--tracker-params', tmp_path / 'tracker.yaml')
    assert result.returncode == 2 and complaint in result.stdout and 'Traceback' not in result.stdout


def test_parameter_files_of_the_nodes_serve(scene, tmp_path):
    config = os.path.join(os.path.dirname(__file__), '..', '..', 'config')
    (tmp_path / 'tracker.yaml').write_text('tracker: thesis\ntarget_frame: odom\n')
    result = run_tool(scene, tmp_path / 'out.bag', '--detector', 'depth', '--tracker-params', tmp_path / 'tracker.yaml',
                      '--bbox3d-params', os.path.join(config, 'bbox3d.yaml'),
                      '--depth-params', os.path.join(config, 'depth_detector.yaml'))
    assert result.returncode == 0, result.stdout
    assert messages_in(tmp_path / 'out.bag')['/ros_3d_bb/tracks'][-1].header.frame_id == 'odom'


def test_results_get_the_rights_that_the_user_wants(scene, tmp_path):
    before = os.umask(0o027)
    try:
        process_bag(scene, str(tmp_path / 'out.bag'), DEPTH)
    finally:
        os.umask(before)
    assert stat.S_IMODE(os.stat(str(tmp_path / 'out.bag')).st_mode) == 0o640


def test_a_full_disk_is_named_and_an_older_result_stays(scene, tmp_path):
    """No file may grow beyond 50 kB, as on a disk with so much left; then they may."""
    target = tmp_path / 'out.bag'
    target.write_text('an older result')
    command = ['rosrun', 'ros_3d_bb', 'process_bag', '--detector', 'depth', scene, str(target)]
    limit = (50000, resource.getrlimit(resource.RLIMIT_FSIZE)[1])
    result = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, universal_newlines=True,
                            preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, limit))
    assert result.returncode == 1 and 'File too large' in result.stdout and 'no bag was written' in result.stdout
    assert 'Traceback' not in result.stdout
    assert os.listdir(str(tmp_path)) == ['out.bag'] and target.read_text() == 'an older result'
    assert run_tool('--detector', 'depth', scene, target).returncode == 0 and messages_in(target)


def test_no_code_is_made_of_the_definitions_in_a_bag(tmp_path, monkeypatch):
    """rosbag would write Python code for it, and import that."""
    with rosbag.Bag(str(tmp_path / 'in.bag'), 'w') as bag:
        unused = type('Unused', (), {'_md5sum': '0' * 32})
        header = {'topic': '/a', 'type': 'a/B', 'md5sum': '0' * 32, 'message_definition': 'int32 x'}
        bag.write('/a', ('a/B', b'1234', '0' * 32, unused), time_from(1), raw=True, connection_header=header)
    made = []
    monkeypatch.setattr(genpy.dynamic, 'generate_dynamic', lambda *given: made.append(given))
    with BagReader(str(tmp_path / 'in.bag')) as reader:
        assert [raw.data for raw in reader.messages()] == [b'1234']
    assert not made


def test_a_bag_that_unpacks_to_more_than_the_memory_is_refused(tmp_path):
    """640 MB of zeros are 500 bytes of bz2."""
    path = tmp_path / 'in.bag'
    with rosbag.Bag(str(path), 'w', compression='bz2') as bag:
        bag.write('/camera/color/image_raw', Image(), time_from(1))
    content = path.read_bytes()
    start = content.index(b'BZh')
    with rosbag.Bag(str(path)) as bag:
        header, = bag._chunk_headers.values()
    rest = content[start + header.compressed_size:]
    packer = bz2.BZ2Compressor()
    bomb = b''.join(packer.compress(bytes(2 ** 24)) for _part in range(40)) + packer.flush()
    # Positions behind the chunk are told by the file's header alone.
    index = struct.unpack('<Q', content[content.index(b'index_pos=') + 10:][:8])[0]
    moved = content.replace(b'index_pos=' + struct.pack('<Q', index),
                            b'index_pos=' + struct.pack('<Q', index + len(bomb) - header.compressed_size), 1)
    path.write_bytes(moved[:start - 4] + struct.pack('<L', len(bomb)) + bomb + rest)
    result = run_tool(path, tmp_path / 'out.bag', '--detector', 'depth', '--memory', '0.5')
    assert result.returncode == 1 and 'Traceback' not in result.stdout, result.stdout
    assert '%s: more than 0.5 GiB of memory (--memory)' % path in result.stdout, result.stdout
    assert os.listdir(str(tmp_path)) == ['in.bag']
