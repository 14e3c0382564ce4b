"""Nodes of measure.launch, with a stand-in for realsense2_camera, which may not be installed."""
import pytest

from support import launching
from support.launching import dumped, given_to_stand_ins

LAUNCH, REQUIRED = 'measure.launch', ['session:=/a session', 'weights:=/some.pt']


def loaded(*arguments):
    return launching.loaded(LAUNCH, *REQUIRED + list(arguments))


def test_without_camera_realsense2_camera_is_not_needed():
    parameters, nodes = loaded()
    assert set(nodes) == {'people_node', 'viewer_node'}
    assert parameters['/viewer_node/session'] == '/a session' and parameters['/viewer_node/window'] is True
    assert parameters['/tracker_node/target_frame'] == 'map'
    assert nodes['viewer_node'].required


def test_the_camera_aligns_depth_and_its_frame_is_the_target(camera_package):
    parameters = dumped(LAUNCH, camera_package, 'camera:=true', 'detector:=depth', *REQUIRED)
    assert given_to_stand_ins(parameters)['align_depth'] == 'true'
    assert parameters['/tracker_node/target_frame'] == 'camera_link'
    assert parameters['/depth_detector_node/floor_frame'] == ''


def test_the_camera_can_be_read_by_realsense_node():
    _parameters, nodes = loaded('camera:=true', 'driver:=pyrealsense2')
    assert 'realsense_node' in nodes


@pytest.mark.parametrize('detector', ['yolov5', 'depth'])
def test_the_viewer_pauses_the_running_detector(detector):
    parameters, nodes = loaded('detector:=' + detector)
    service = dict(nodes['viewer_node'].remap_args)['detector/enable']
    assert service.endswith('_node/enable') and '/%s/floor_frame' % service.split('/')[0] in parameters


def test_viewer_and_pipeline_have_the_same_topics():
    _parameters, nodes = loaded('camera_image:=a/color', 'camera_depth:=a/depth', 'camera_info:=a/info',
                                'bb_topic:=a/boxes', 'record:=/some where/a.bag')
    remaps = [dict(nodes[name].remap_args) for name in ('viewer_node', 'people_node')]
    for topic, name in (('camera/color/image_raw', 'a/color'), ('camera/color/camera_info', 'a/info'),
                        ('camera/aligned_depth_to_color/image_raw', 'a/depth'), ('yolo_bounding_box', 'a/boxes')):
        assert [remap[topic] for remap in remaps] == [name] * 2
        assert '/' + name in nodes['recorder'].args.split()
    assert "--output-name '/some where/a.bag'" in nodes['recorder'].args
