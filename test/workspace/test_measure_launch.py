"""What measure.launch starts, with a stand-in for realsense2_camera, which is not on every machine."""
import os
import subprocess
import sys

import pytest
import roslaunch
import yaml

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
# of the arguments that rs_camera.launch of realsense2_camera 2.3 declares, those that are asked for
RS_CAMERA = """<launch>
  <arg name="align_depth" default="false"/>
  <param name="align_depth" value="$(arg align_depth)"/>
</launch>"""


@pytest.fixture
def with_realsense(tmp_path):
    """An environment in which there is a package of that name."""
    package = tmp_path / 'realsense2_camera'
    (package / 'launch').mkdir(parents=True)
    (package / 'package.xml').write_text('<package format="2"><name>realsense2_camera</name></package>')
    (package / 'launch' / 'rs_camera.launch').write_text(RS_CAMERA)
    return dict(os.environ, ROS_PACKAGE_PATH='%s:%s' % (tmp_path, os.environ['ROS_PACKAGE_PATH']))


LAUNCH, REQUIRED = os.path.join(ROOT, 'launch', 'measure.launch'), ['session:=/a session', 'weights:=/some.pt']


def loaded(*arguments):
    """Parameters {name: value} and nodes {name: node} that roslaunch would set and start."""
    loader, config = roslaunch.xmlloader.XmlLoader(resolve_anon=False), roslaunch.config.ROSLaunchConfig()
    loader.load(LAUNCH, config, argv=REQUIRED + list(arguments), verbose=False)
    return ({name: parameter.value for name, parameter in config.params.items()},
            {node.name: node for node in config.nodes})


def test_without_a_camera_of_its_own_it_needs_no_realsense():
    parameters, nodes = loaded()
    assert set(nodes) == {'yolov5_node', 'bbox3d_node', 'tracker_node', 'viewer_node'}
    assert parameters['/viewer_node/session'] == '/a session' and parameters['/viewer_node/window'] is True
    assert parameters['/tracker_node/target_frame'] == 'map'
    assert nodes['viewer_node'].required


def test_the_camera_aligns_depth_and_needs_no_robot(with_realsense):
    command = [sys.executable, '-c', 'import roslaunch; roslaunch.main()', '--dump-params', LAUNCH]
    parameters = yaml.safe_load(subprocess.check_output(command + REQUIRED + ['camera:=true', 'detector:=depth'],
                                                        env=with_realsense))
    assert parameters['/align_depth'] is True
    assert parameters['/tracker_node/target_frame'] == 'camera_link'
    assert parameters['/depth_detector_node/floor_frame'] == ''


@pytest.mark.parametrize('detector', ['yolov5', 'depth'])
def test_the_detector_that_runs_is_the_one_that_is_paused(detector):
    _parameters, nodes = loaded('detector:=' + detector)
    service = dict(nodes['viewer_node'].remap_args)['detector/enable']
    assert service.split('/')[0] in nodes and service.endswith('_node/enable')


def test_what_the_viewer_shows_is_what_the_pipeline_works_on():
    _parameters, nodes = loaded('camera_image:=a/color', 'camera_depth:=a/depth', 'camera_info:=a/info',
                                'bb_topic:=a/boxes', 'record:=/some where/a.bag')
    remaps = [dict(nodes[name].remap_args) for name in ('viewer_node', 'bbox3d_node')]
    for topic, name in (('camera/color/image_raw', 'a/color'), ('camera/color/camera_info', 'a/info'),
                        ('camera/aligned_depth_to_color/image_raw', 'a/depth'), ('yolo_bounding_box', 'a/boxes')):
        assert [remap[topic] for remap in remaps] == [name] * 2
        assert '/' + name in nodes['recorder'].args.split()
    assert "--output-name '/some where/a.bag'" in nodes['recorder'].args
