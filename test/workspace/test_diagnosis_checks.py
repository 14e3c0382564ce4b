from types import SimpleNamespace

import numpy as np
import pytest

from ros_3d_bb.camera.camera_model import Camera
from ros_3d_bb.camera.images import DepthImage, mounted_camera
from ros_3d_bb.conversions.image_msgs import units_fault
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.detection.depth.ground_plane import CameraPose
from ros_3d_bb.diagnosis.camera_mount import CameraMount
from ros_3d_bb.diagnosis.checks import findings
from ros_3d_bb.diagnosis.observations import Newest, Observations, Publisher, Role, Stream, TfSeen
from ros_3d_bb.diagnosis.roles import BOXES2D, BOXES3D, COLOR, DEPTH, INFO, TRACKS
from ros_3d_bb.diagnosis.tf_tree import Link

IMAGE, CAMERA = 'sensor_msgs/Image', Camera(640, 480, 600, 600, 320, 240)
STAMPS = tuple(1000 * NS + number * NS // 10 for number in range(50))
KINDS = ((COLOR, 'colour images', IMAGE, 'camera_image'), (DEPTH, 'depth images', IMAGE, 'camera_depth'),
         (INFO, 'camera_info', 'sensor_msgs/CameraInfo', 'camera_info'),
         (BOXES2D, '2D boxes', 'std_msgs/Int32MultiArray', 'bb_topic'),
         (BOXES3D, '3D boxes', 'ros_3d_bb/BoundingBox3DArray', ''),
         (TRACKS, 'tracks', 'ros_3d_bb/TrackedObjectArray', ''))
ROLES = {key: Role(title, 'camera/' + key, kind, argument, 'the source', 'wake it up')
         for key, title, kind, argument in KINDS}
LINKS = {'odom': Link('map', 990, 1010), 'base_link': Link('odom', 990, 1010), 'camera_link': Link('base_link', 0, 0),
         'optical': Link('camera_link', 0, 0)}
FLOOR_FROM_CAMERA = mounted_camera(0.26, 0.0, 0)
INFO_SEEN = Newest(SimpleNamespace(header=SimpleNamespace(frame_id='optical')), CAMERA)


def image_seen(encoding, width=640, frame_id='optical', fault=''):
    header = SimpleNamespace(frame_id=frame_id)
    return Newest(SimpleNamespace(header=header, width=width, height=480, encoding=encoding), None, fault)


def sound_stream(key, **changes):
    role = ROLES[key]
    stream = Stream(role, '/' + role.name, role.kind, (Publisher('/node'),), 50, 10.0, STAMPS, 0.05, 0.05)
    return stream._replace(**changes)


def sound(**changes):
    """Observations of a working pipeline, with some fields changed."""
    streams = {key: sound_stream(key) for key in ROLES}
    topics = {stream.topic: stream.role.kind for stream in streams.values()}
    seen = Observations(streams, topics, 5.0, color_info=INFO_SEEN, depth_info=INFO_SEEN,
                        color=image_seen('rgb8'), depth=image_seen('16UC1'),
                        tf=TfSeen('map', 'optical', 1000.0, LINKS, ''), nodes={'tracker_node': (0, 'working')})
    return seen._replace(**changes)


def with_stream(key, **changes):
    seen = sound()
    seen.streams[key] = sound_stream(key, **changes)
    return seen


def silent(key, **changes):
    return with_stream(key, count=0, rate_hz=0.0, stamps_ns=(), lag_s=None, **changes)


def late(lag_s, tf_fault=''):
    """Messages that arrive some time after their stamps."""
    return sound(streams={key: sound_stream(key, lag_s=lag_s) for key in ROLES},
                 tf=TfSeen('map', 'optical', 1000.0, LINKS, tf_fault))


def without_tf(*missing, **changed):
    """No transform, as frames are missing in tf or links are changed."""
    links = {frame: link for frame, link in dict(LINKS, **changed).items() if frame not in missing}
    return sound(tf=TfSeen('map', 'optical', 1000.0, links, 'the error of tf2'))


def with_tf_clock(lags_s, in_time):
    tf = TfSeen('map', 'optical', 1000.0, LINKS, '', lags_s=lags_s, in_time=in_time)
    return sound(tf=tf)


def moved(stamps_ns, by_s):
    return tuple(stamp_ns + int(by_s * NS) for stamp_ns in stamps_ns)


def exact(seen):
    return seen._replace(stamp_tolerance_s=0.005)


CASES = [
    (silent(DEPTH, published_kind='', publishers=()), 'depth images', 'no publishers on /camera/depth', 'the source'),
    (silent(INFO, published_kind='sensor_msgs/Image'), 'camera_info', 'has the type sensor_msgs/Image', 'start'),
    (silent(DEPTH), 'depth images', 'no messages on /camera/depth for 5 s, although /node publishes it', 'wake it'),
    (with_stream(COLOR, rate_hz=1.5), 'colour images', 'only 1.5 Hz', 'USB 3'),
    (sound(depth=image_seen('16UC1', frame_id='depth_optical')), 'alignment', 'frame depth_optical', 'align_depth'),
    (sound(depth=image_seen('16UC1', fault='metres in a 16UC1')), 'depth encoding', 'metres in a 16UC1',
     'depth_scale'),
    (with_stream(DEPTH, stamps_ns=(), lag_s=None), 'stamps', 'no stamp (zero)', 'set it to the time'),
    (with_stream(DEPTH, lag_s=9e6), 'stamps', '104.2 days before ROS time', 'use_sim_time true'),
    (exact(with_stream(COLOR, stamps_ns=moved(STAMPS, 0.05))), 'pairs', 'only 0 %', 'stamp_tolerance'),
    (with_stream(DEPTH, lag_s=3.05), 'pairs', 'arrive together are 3.0 s apart', 'same clock'),
    (sound(tf=TfSeen('map', '', 1000.0, LINKS, 'the error of tf2')), 'transforms', 'no frame_id', 'frame_id:=FRAME'),
    (sound(tf=TfSeen('map', 'camera_link', 1000.0, LINKS, '', 'camera_link is not optical')), 'transforms',
     'is not optical', '0 0 0 -1.5708 0 -1.5708 camera_link camera_link_optical_frame'),
    (without_tf(*LINKS), 'transforms', 'tf has no frames', 'robot_state_publisher'),
    (without_tf(*LINKS)._replace(mount=CameraMount(8, {0: 9}, 0, CameraPose(0.27, 0.01, 0.0))), 'transforms',
     'tf has no frames', 'camera_height:=0.27 camera_tilt:=0.01'),
    (sound(tf=TfSeen('optical', 'optical', 1000.0, {}, '')), 'transforms', 'is an optical frame', 'camera_height:='),
    (without_tf('odom'), 'transforms', 'tf has no frame map', 'frame_world:=odom'),
    (without_tf('camera_link'), 'transforms', 'tf has two trees',
     'static_transform_publisher X Y Z YAW PITCH ROLL base_link camera_link'),
    (without_tf('optical', rgb_optical_frame=Link('camera_link', 0, 0)), 'transforms', 'tf has no frame optical',
     'frame_id:=rgb_optical_frame'),
    (without_tf(base_link=Link('odom', 980, 995)), 'transforms',
     'the transform from base_link to odom ends 5.000 s before', 'publisher of base_link'),
    (without_tf(odom=Link('map', 1003, 1010)), 'transforms', 'the transform from odom to map begins 3.000 s after',
     'clocks'),
    (with_tf_clock({'odom': -3.0, 'base_link': 0.0}, 1.0), 'transforms', 'from odom to map are 3.0 s after', 'clocks'),
    (sound(color=image_seen('rgb8', width=320)), 'camera', 'the colour image has 320 x 480 pixels', 'calibration'),
    (sound(mount=CameraMount(8, {0: 0}, 0, CameraPose(1.04, 0.0, 0.0),
                             {0.2: (16, CameraPose(0.21, 0.0, 0.0)), 0.25: (15, CameraPose(0.26, 0.0, 0.0))}),
           depth=image_seen('16UC1')._replace(converted=DepthImage(np.zeros((4, 4), np.uint16), 0.001)),
           tf=TfSeen('map', 'optical', 1000.0, LINKS, '', '', FLOOR_FROM_CAMERA)), 'depth unit', 'multiplied by 0.25',
     'depth_scale: 0.00025'),
    (silent(BOXES2D), '2D boxes', 'no messages on /camera/boxes2d', 'wake it up'),
    (exact(with_stream(BOXES2D, stamps_ns=moved(STAMPS, 0.05))), 'boxes and depth', 'only 0 %', 'label'),
    (with_stream(BOXES2D, lag_s=1.6), 'boxes and depth', '1.6 s after their depth image', 'cache_length'),
    (with_stream(COLOR, senders=('/camera', '/play_1')), 'publishers', '/camera and /play_1', 'stop all'),
    (sound(tf_senders={'base_link': ('/ekf', '/odometry')}), 'publishers', 'base_link of tf', 'stop all'),
    (sound(nodes={'tracker_node': (1, 'no transform')}), 'tracker_node', 'no transform', 'log'),
    (sound(use_sim_time=True), 'time', 'no messages on /clock', 'use_sim_time false'),
    (sound(clock_count=9), 'time', '/use_sim_time is not set', 'use_sim_time true')]


def faults_in(seen):
    return [finding for finding in findings(seen) if finding.fault]


def test_a_working_pipeline_has_no_faults_and_a_fact_of_each_check():
    found = findings(sound())
    assert faults_in(sound()) == []
    assert len(found) > 14 and all(len(finding.lines) == 1 and finding.fact for finding in found)


@pytest.mark.parametrize('stamps_ns, lag_s', [((), None), (STAMPS[:1], 7300.0), (STAMPS[:1] * 50, 7300.0)])
@pytest.mark.parametrize('is_bag', [False, True])
def test_camera_info_needs_no_stamp_of_its_image(stamps_ns, lag_s, is_bag):
    assert faults_in(with_stream(INFO, stamps_ns=stamps_ns, lag_s=lag_s)._replace(is_bag=is_bag)) == []


def test_a_wrong_frame_that_a_parameter_replaces_is_no_fault():
    assert faults_in(sound(depth=image_seen('16UC1', frame_id='wrong'), frame_id='optical')) == []


@pytest.mark.parametrize('seen, subject, fault, fix', CASES)
def test_a_fault_is_reported_with_its_fix(seen, subject, fault, fix):
    found = faults_in(seen)
    assert [finding for finding in found
            if finding.subject == subject and fault in finding.fault and fix in finding.fix], found
    first, second = found[0].lines
    assert first.startswith('wrong  ') and second.startswith('       fix: ')


def with_lags(lag_s, machine_lag_s):
    """Messages of a pipeline with simulated time."""
    streams = {key: sound_stream(key, lag_s=lag_s, machine_lag_s=machine_lag_s) for key in ROLES}
    return sound(streams=streams, use_sim_time=True, clock_count=9)


def test_stamps_of_a_live_camera_do_not_fit_the_time_of_a_bag():
    wrong, = faults_in(with_lags(-1e9, 0.1))
    assert 'the clock of the machine' in wrong.fault and 'use_sim_time false' in wrong.fix


@pytest.mark.parametrize('count', [0, 50])  # of 3D boxes: 50 are those of the images before
def test_consequences_of_a_fault_are_not_reported(count):
    """Without depth: nothing about its alignment, unit or pairs, or about nodes that wait for it."""
    seen = silent(DEPTH, published_kind='', publishers=())._replace(
        depth=None, tf=None, nodes={'bbox3d_node': (1, 'no depth image has come')})
    seen.streams[BOXES3D] = sound_stream(BOXES3D, count=count)
    seen.streams[TRACKS] = sound_stream(TRACKS, count=0)
    assert [finding.subject for finding in faults_in(seen)] == ['depth images']


def test_a_bag_needs_no_boxes_and_one_with_boxes_no_colour():
    seen = sound(is_bag=True, nodes={})
    for key in (BOXES2D, BOXES3D, TRACKS):
        seen.streams[key] = sound_stream(key, count=0, published_kind='')
    assert not faults_in(seen)
    seen.streams[BOXES2D], seen.streams[COLOR] = sound_stream(BOXES2D), sound_stream(COLOR, count=0, published_kind='')
    assert not faults_in(seen)


@pytest.mark.parametrize('seen, fault, fix', [
    (silent(INFO, published_kind='')._replace(color_info=None), 'there is no /camera/info in the bag', 'record it'),
    (silent(INFO), 'no messages on /camera/info in the first 5 s', 'record it'),
    (with_stream(DEPTH, lag_s=7300.0), 'stamps on /camera/color and /camera/depth that arrive together', 'same clock'),
    (late(7300.0), 'the stamps on /camera/color are 2.0 hours from the time', 'process_bag accepts'),
    (late(7300.0, tf_fault='the error of tf2'), 'the stamps on /camera/color are 2.0 hours', 'play with --clock')])
def test_a_fault_of_a_bag_is_reported_with_its_fix(seen, fault, fix):
    wrong, *others = faults_in(seen._replace(is_bag=True))
    assert wrong.fault.startswith(fault) and fix in wrong.fix
    assert not seen.tf.fault and not others or seen.tf.fault and 'process_bag accepts' not in wrong.fix


@pytest.mark.parametrize('values, scale_m, fault', [
    (np.full((48, 64), 3, np.uint16), 0.001, 'metres in a 16UC1'),
    (np.full((48, 64), 3000.0, np.float32), 1.0, 'millimetres in a 32FC1'),
    (np.full((48, 64), 3000, np.uint16), 0.001, ''), (np.zeros((48, 64), np.uint16), 0.001, '')])
def test_units_are_checked_by_the_depth_of_most_pixels(values, scale_m, fault):
    found = units_fault(DepthImage(values, scale_m))
    assert fault in found and bool(fault) == bool(found)
