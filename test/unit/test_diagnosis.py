"""From what was seen to what is wrong and its fix: each fault alone in a sound pipeline."""
import numpy as np
import pytest

from ros_3d_bb.camera.alignment import frames_fault, intrinsics_fault
from ros_3d_bb.camera.camera_model import Camera
from ros_3d_bb.camera.depth_image import DepthImage
from ros_3d_bb.conversions.image_msgs import units_fault
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.diagnosis.checks import BOXES2D, BOXES3D, COLOR, DEPTH, INFO, TRACKS, findings
from ros_3d_bb.diagnosis.observations import (CameraSeen, Clock, Finding, ImageSeen, Observations, Publisher, Role,
                                              Stream, TfSeen)
from ros_3d_bb.diagnosis.tf_tree import Link, chain, links_in, why_missing
from ros_3d_bb.diagnosis.topic_faults import paired_share, span

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


def sound_stream(key, **changes):
    role = ROLES[key]
    stream = Stream(role, '/' + role.name, role.kind, (Publisher('/node'),), 50, 10.0, STAMPS, 0.05, 0.05)
    return stream._replace(**changes)


def sound(**changes):
    """What is seen of a pipeline in which all is well, but for some changes."""
    streams = {key: sound_stream(key) for key in ROLES}
    topics = {stream.topic: stream.role.kind for stream in streams.values()}
    seen = Observations(streams, topics, 5.0, color_camera=CameraSeen(CAMERA, 'optical'),
                        depth_camera=CameraSeen(CAMERA, 'optical'), color=ImageSeen(640, 480, 'rgb8', 'optical'),
                        depth=ImageSeen(640, 480, '16UC1', 'optical'), tf=TfSeen('map', 'optical', 1000.0, LINKS, ''),
                        clock=Clock(False, 0), nodes={'tracker_node': (0, 'working')})
    return seen._replace(**changes)


def with_stream(key, **changes):
    seen = sound()
    seen.streams[key] = sound_stream(key, **changes)
    if changes.get('count') == 0 and not changes.get('published_kind', 'some'):
        del seen.topics['/' + ROLES[key].name]
    return seen


def silent(key, **changes):
    return with_stream(key, count=0, rate_hz=0.0, stamps_ns=(), lag_s=None, **changes)


def other_named(key, name):
    """The messages of a role come on another topic."""
    seen = silent(key, published_kind='', publishers=())
    seen.topics[name] = ROLES[key].kind
    return seen


def without_tf(links, stamp_s=1000.0):
    return sound(tf=TfSeen('map', 'optical', stamp_s, links, 'tf2 says no'))


def moved(stamps_ns, by_s):
    return tuple(stamp_ns + int(by_s * NS) for stamp_ns in stamps_ns)


def test_a_sound_pipeline_has_no_faults_and_each_check_says_a_fact():
    found = findings(sound())
    assert [finding for finding in found if finding.is_wrong] == []
    assert len(found) > 14 and all(len(finding.lines) == 1 and finding.fact for finding in found)


CASES = [
    (silent(DEPTH, published_kind='', publishers=()), 'depth images', 'nobody publishes /camera/depth', 'the source'),
    (other_named(DEPTH, '/front/depth'), 'depth images', 'nobody publishes', 'camera/depth:=/front/depth (launch '
     'argument camera_depth:=/front/depth)'),
    (silent(INFO, published_kind='sensor_msgs/Image'), 'camera_info', 'has the type sensor_msgs/Image', 'start'),
    (silent(COLOR, publishers=(Publisher('/driver', 'it calls its machine robot'),)), 'colour images',
     '/driver publishes it, but it calls its machine robot', 'ROS_IP'),
    (silent(DEPTH), 'depth images', 'nothing has come on /camera/depth for 5 s, though /node publishes it', 'wake it'),
    (with_stream(COLOR, rate_hz=1.5), 'colour images', 'only 1.5 Hz', 'USB 3'),
    (sound(color_camera=CameraSeen(None, 'optical', 'it is empty')), 'camera', 'it is empty', 'camera_calibration'),
    (sound(depth=ImageSeen(848, 480, '16UC1', 'optical')), 'alignment', '848 x 480 pixels', 'align_depth:=true'),
    (sound(depth_camera=CameraSeen(CAMERA._replace(fx=385.0), 'optical')), 'alignment', '385.0', 'align_depth:=true'),
    (sound(depth=ImageSeen(640, 480, '16UC1', 'depth_optical')), 'alignment', 'frame depth_optical', 'align_depth'),
    (sound(depth=ImageSeen(640, 480, '16UC1', 'optical', 'metres in a 16UC1')), 'depth encoding', 'metres in a 16UC1',
     'depth_scale'),
    (sound(color=ImageSeen(640, 480, 'yuv422', 'optical', "has encoding 'yuv422'")), 'colour encoding', 'yuv422',
     'rgb8'),
    (with_stream(DEPTH, stamps_ns=(), lag_s=None), 'stamps', 'no stamp (zero)', 'copy the time'),
    (with_stream(DEPTH, lag_s=9e6), 'stamps', '104.2 days before ROS time', 'use_sim_time true'),
    (with_stream(DEPTH, lag_s=-9.0), 'stamps', '9.0 s after ROS time', 'chrony'),
    (with_stream(COLOR, stamps_ns=moved(STAMPS, 0.05)), 'pairs', 'only 0 %', 'stamp_tolerance'),
    (without_tf({}), 'transforms', 'tf knows no frames at all', 'robot_state_publisher'),
    (without_tf({key: link for key, link in LINKS.items() if key != 'odom'}), 'transforms', 'tf knows no frame map',
     'frame_world:=odom'),
    (without_tf({key: link for key, link in LINKS.items() if key != 'camera_link'}), 'transforms', 'tf has two trees',
     'static_transform_publisher X Y Z YAW PITCH ROLL base_link camera_link'),
    (without_tf({key: link for key, link in LINKS.items() if key != 'optical'}), 'transforms',
     'tf knows no frame optical', 'frame_id:='),
    (without_tf(dict(LINKS, base_link=Link('odom', 980, 995)), 1000.0), 'transforms',
     'the transform from base_link to odom ends 5.000 s before', 'what publishes base_link'),
    (without_tf(dict(LINKS, odom=Link('map', 1003, 1010)), 1000.0), 'transforms',
     'the transform from odom to map begins 3.000 s after', 'clocks'),
    (silent(BOXES2D), 'detector', 'images come and no 2D boxes', 'wake it up'),
    (with_stream(BOXES2D, stamps_ns=moved(STAMPS, 0.05)), 'boxes and depth', 'only 0 %', 'label'),
    (with_stream(BOXES2D, lag_s=1.6), 'boxes and depth', '1.6 s after their depth image', 'cache_length'),
    (silent(BOXES3D), '3D boxes', 'nothing has come on /camera/boxes3d', 'wake it up'),
    (silent(TRACKS), 'tracks', 'nothing has come on /camera/tracks', 'wake it up'),
    (sound(nodes={'tracker_node': (1, 'no transform')}), 'tracker_node', 'no transform', 'log'),
    (sound(clock=Clock(True, 0)), 'time', 'nothing comes on /clock', 'use_sim_time false'),
    (sound(clock=Clock(False, 9)), 'time', '/use_sim_time is not set', 'use_sim_time true')]


@pytest.mark.parametrize('number', range(len(CASES)))
def test_what_is_wrong_is_named_with_its_fix(number):
    seen, subject, fault, fix = CASES[number]
    found = [finding for finding in findings(seen) if finding.is_wrong]
    assert [finding for finding in found
            if finding.subject == subject and fault in finding.fault and fix in finding.fix], found
    first, second = found[0].lines
    assert first.startswith('wrong  ') and second.startswith('       fix: ')


def test_a_camera_that_runs_now_does_not_need_the_time_of_a_bag():
    seen = sound(clock=Clock(True, 9))
    for key in seen.streams:
        seen.streams[key] = sound_stream(key, lag_s=-1e9, machine_lag_s=0.1)
    wrong, = (finding for finding in findings(seen) if finding.is_wrong)
    assert 'of the clock of the machine' in wrong.fault and 'use_sim_time false' in wrong.fix


def test_what_follows_from_a_fault_is_not_named_beside_it():
    """Without depth: no word of its alignment, its unit, its pairs, nor of nodes that miss it."""
    seen = silent(DEPTH, published_kind='', publishers=())._replace(
        depth=None, tf=None, nodes={'bbox3d_node': (1, 'no depth image has come')})
    seen.streams[BOXES3D] = sound_stream(BOXES3D, count=0)
    seen.streams[TRACKS] = sound_stream(TRACKS, count=0)
    assert [finding.subject for finding in findings(seen) if finding.is_wrong] == ['depth images']
    seen.streams[BOXES3D] = sound_stream(BOXES3D)  # of the images before
    assert [finding.subject for finding in findings(seen) if finding.is_wrong] == ['depth images']


def test_before_the_first_clock_nothing_is_said_of_stamps():
    seen = sound(clock=Clock(True, 9))
    for key in seen.streams:
        seen.streams[key] = sound_stream(key, lag_s=None, machine_lag_s=None)
    assert not any(finding.is_wrong or finding.subject == 'stamps' for finding in findings(seen))


def test_a_bag_needs_no_boxes_and_one_with_boxes_no_colour():
    seen = sound(is_bag=True, clock=None, nodes={})
    for key in (BOXES2D, BOXES3D, TRACKS):
        seen.streams[key] = sound_stream(key, count=0, published_kind='')
    assert not any(finding.is_wrong for finding in findings(seen))
    seen.streams[BOXES2D], seen.streams[COLOR] = sound_stream(BOXES2D), sound_stream(COLOR, count=0, published_kind='')
    assert not any(finding.is_wrong for finding in findings(seen))


def test_what_a_bag_lacks_has_to_be_recorded():
    seen = silent(INFO, published_kind='')._replace(is_bag=True, clock=None, color_camera=None)
    wrong, = (finding for finding in findings(seen) if finding.is_wrong)
    assert wrong.fault == 'there is no /camera/info in it' and wrong.fix.startswith('record it')
    wrong, = (finding for finding in findings(silent(INFO)._replace(is_bag=True, clock=None)) if finding.is_wrong)
    assert wrong.fault == 'there is nothing on /camera/info in the first 5 s'


def test_stamps_far_from_the_time_of_recording_are_named():
    seen = with_stream(DEPTH, lag_s=7300.0)._replace(is_bag=True, clock=None)
    wrong, = (finding for finding in findings(seen) if finding.is_wrong)
    assert '2.0 hours from the time of their recording' in wrong.fault


@pytest.mark.parametrize('values, scale_m, said', [
    (np.full((48, 64), 3, np.uint16), 0.001, 'metres in a 16UC1'),
    (np.full((48, 64), 3000.0, np.float32), 1.0, 'millimetres in a 32FC1'),
    (np.full((48, 64), 3000, np.uint16), 0.001, ''), (np.full((48, 64), 3.0, np.float32), 1.0, ''),
    (np.zeros((48, 64), np.uint16), 0.001, ''), (np.full((48, 64), np.nan, np.float32), 1.0, ''),
    (np.full((2, 2), 3, np.uint16), 0.001, ''), (np.full((48, 64), 3, np.uint16), 1.0, '')])
def test_units_are_judged_by_where_most_pixels_are(values, scale_m, said):
    fault = units_fault(DepthImage(values, scale_m))
    assert said in fault and bool(said) == bool(fault)


def test_cameras_are_the_same_within_a_pixel():
    assert intrinsics_fault(CAMERA, CAMERA._replace(cx=320.4)) == ''
    assert 'fx fy cx cy of depth are 600.0 600.0 330.0 240.0' in intrinsics_fault(CAMERA, CAMERA._replace(cx=330.0))
    assert '848 x 480' in intrinsics_fault(CAMERA, CAMERA._replace(width=848))
    assert frames_fault('/optical', 'optical') == frames_fault('', 'optical') == ''


def test_links_are_read_as_tf2_writes_them():
    text = ("odom: \n  parent: 'map'\n  broadcaster: 'me'\n  rate: 10000.000\n  most_recent_transform: 100.500\n"
            '  oldest_transform: 99.000\n  buffer_length: 1.500\n')
    assert links_in(text) == {'odom': Link('map', 99.0, 100.5)}
    assert links_in('') == links_in('[]') == links_in('*: {') == {}
    assert chain(links_in(text), 'odom') == ['odom', 'map']
    assert chain({'a': Link('b', 0, 0), 'b': Link('a', 0, 0)}, 'a') == ['a', 'b']  # no end of it, but an answer


def test_of_the_newest_transform_nothing_is_said_about_time():
    assert why_missing(LINKS, 'map', 'optical', 0.0) == ('', '')


@pytest.mark.parametrize('by_s, share', [(0.0, 1.0), (0.004, 1.0), (0.05, 0.0), (100.0, None)])
def test_stamps_pair_within_the_tolerance(by_s, share):
    assert paired_share(moved(STAMPS[1:-1], by_s), STAMPS, 0.005) == share


def test_times_are_said_so_that_one_can_grasp_them():
    assert [span(seconds) for seconds in (0.25, 119, 150, 9000, 9e6)] == [
        '0.2 s', '119.0 s', '2.5 minutes', '2.5 hours', '104.2 days']


def test_a_finding_is_printed_in_a_line_or_with_its_fix_in_two():
    assert Finding('time', 'of the machine').lines == ['ok     time: of the machine']
    assert Finding('time', '', 'it stands still', 'play').lines == ['wrong  time: it stands still', '       fix: play']
