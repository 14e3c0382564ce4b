"""Camera in the description of a Jackal, nodes of jackal.launch and desk.launch, and names in the packages of a Jackal.

The packages come from an archive in ROS_3D_BB_DATA; without it, excerpts of them are used.
"""
import os
import re
import tarfile
import xml.etree.ElementTree as ElementTree

import numpy as np
import pytest
import roslaunch
import xacro
import yaml

from ros_3d_bb.pipeline.detection_stage import DepthDetectorParams
from support.launching import ROOT, dumped, given_to_stand_ins, loaded, write
from support.urdf import base_from

CAMERA = os.path.join(ROOT, 'urdf', 'jackal_d435i.urdf.xacro')
ARCHIVE = os.path.join(os.environ.get('ROS_3D_BB_DATA', ''), 'gazebo', 'jackal.tar.xz')
# Excerpts of the packages: mounting links, the hook for extensions of the description, and names. Source:
# github.com/jackal/jackal (commit c6ab6ca), jackal_description, jackal_control and jackal_navigation.
JACKAL = """<robot name="jackal" xmlns:xacro="http://www.ros.org/wiki/xacro">
  <link name="base_link"/> <link name="chassis_link"/> <link name="mid_mount"/> <link name="front_mount"/>
  <joint name="base_link_joint" type="fixed"><parent link="base_link"/><child link="chassis_link"/></joint>
  <joint name="mid_mount_joint" type="fixed">
    <origin xyz="0 0 0.184"/><parent link="chassis_link"/><child link="mid_mount"/>
  </joint>
  <joint name="front_mount_joint" type="fixed">
    <origin xyz="0.120 0 0"/><parent link="mid_mount"/><child link="front_mount"/>
  </joint>
  <xacro:property name="footprint_vertical_offset" value="-0.0655"/>
  <xacro:include filename="$(optenv JACKAL_URDF_EXTRAS empty.urdf)"/>
</robot>"""
EXCERPTS = {
    'jackal_description/urdf/jackal.urdf.xacro': JACKAL,
    'jackal_control/config/robot_localization.yaml': '{odom_frame: odom, base_link_frame: base_link, frequency: 50}',
    'jackal_control/config/twist_mux.yaml': 'topics: [{name: external, topic: cmd_vel, timeout: 0.5}]',
    'jackal_navigation/params/costmap_common_params.yaml': """{obstacles_layer: {scan: {topic: front/scan}},
        footprint: [[-0.21, -0.165], [-0.21, 0.165], [0.21, 0.165], [0.21, -0.165]]}""",
    'jackal_navigation/launch/include/move_base.launch':
        '<launch><node name="move_base"><remap from="odom" to="odometry/filtered"/></node></launch>',
    'jackal_navigation/launch/amcl_demo.launch':
        """<launch><arg name="scan_topic" default="$(eval optenv('JACKAL_LASER_TOPIC', 'front/scan'))"/></launch>"""}


@pytest.fixture(scope='module')
def packages(tmp_path_factory):
    """Folder of the packages of a Jackal."""
    folder = tmp_path_factory.mktemp('packages')
    if os.path.exists(ARCHIVE):
        with tarfile.open(ARCHIVE) as archive:
            archive.extractall(str(folder))
        for path in folder.glob('jackal/**/*.xacro'):
            text = re.sub(r'<xacro:include filename="\$\(find (?!jackal_).*?/>', '', path.read_text())  # lasers
            # xacro of PyPI finds packages of ROS 2 only.
            path.write_text(re.sub(r'\$\(find (\w+)\)', r'%s/jackal/\1' % folder, text))
        return folder / 'jackal'
    for name, content in EXCERPTS.items():
        write(folder / name, content)
    return folder


@pytest.fixture
def jackal(packages, monkeypatch):
    """Description of a Jackal with the camera, as a function of environment variables."""
    path = packages / 'jackal_description' / 'urdf' / 'jackal.urdf.xacro'

    def described(**variables):
        for name, value in dict(variables, JACKAL_URDF_EXTRAS=CAMERA).items():
            monkeypatch.setenv(name, value)
        return ElementTree.fromstring(xacro.process_file(str(path)).toxml())
    return described


def test_names_and_sizes_are_those_of_the_packages_of_a_jackal(packages):
    def content(name):
        return yaml.safe_load((packages / name).read_text())
    parameters, nodes = loaded('navigation.launch')
    localization = content('jackal_control/config/robot_localization.yaml')
    assert localization['odom_frame'] == parameters['/move_base/local_costmap/global_frame']
    assert localization['base_link_frame'] == parameters['/move_base/local_costmap/robot_base_frame']

    remaps = dict(nodes['move_base'].remap_args)
    external, = (entry for entry in content('jackal_control/config/twist_mux.yaml')['topics']
                 if entry['name'] == 'external')
    assert remaps['cmd_vel'] == external['topic']
    assert 1 / parameters['/move_base/controller_frequency'] < external['timeout']
    move_base = ElementTree.parse(str(packages / 'jackal_navigation/launch/include/move_base.launch'))
    odom, = (remap.get('to') for remap in move_base.iter('remap') if remap.get('from') == 'odom')
    assert parameters['/move_base/DWAPlannerROS/odom_topic'] == odom

    costmap = content('jackal_navigation/params/costmap_common_params.yaml')
    scan = costmap['obstacles_layer']['scan']['topic']
    assert parameters['/move_base/local_costmap/obstacle_layer/scan/topic'] == scan
    chassis, footprint = np.abs(costmap['footprint']), np.abs(parameters['/move_base/local_costmap/footprint'])
    assert (footprint >= chassis).all()  # with wheels and fenders

    description = ElementTree.parse(str(packages / 'jackal_description/urdf/jackal.urdf.xacro'))
    offset, = (float(entry.get('value')) for entry in description.iter() if entry.get('name') ==
               'footprint_vertical_offset')
    assert abs(DepthDetectorParams().floor_height - offset) < 1e-3


@pytest.mark.parametrize('topic', [None, 'rear/scan'])
def test_the_scan_is_the_topic_of_the_laser_of_the_jackal(packages, monkeypatch, topic):
    launch_file = ElementTree.parse(str(packages / 'jackal_navigation/launch/amcl_demo.launch'))
    expected, = (arg.get('default') for arg in launch_file.getroot().findall('arg')
                 if arg.get('name') == 'scan_topic')
    monkeypatch.delenv('JACKAL_LASER_TOPIC', raising=False)
    if topic:
        monkeypatch.setenv('JACKAL_LASER_TOPIC', topic)
    parameters, _nodes = loaded('navigation.launch')
    for costmap in ('local', 'global'):
        assert (parameters['/move_base/%s_costmap/obstacle_layer/scan/topic' % costmap]
                == roslaunch.substitution_args.resolve_args(expected))


def test_the_camera_is_at_the_position_in_the_thesis(jackal):
    base_from_camera = base_from('camera_link', jackal())
    np.testing.assert_allclose(base_from_camera, [[1, 0, 0, 0.17], [0, 1, 0, 0], [0, 0, 1, 0.20], [0, 0, 0, 1]],
                               atol=1e-12)


def test_the_housing_is_on_the_top_plate_and_behind_the_lens(jackal):
    description = jackal()
    plate_m = base_from('front_mount', description)[2, 3]
    for kind in ('visual', 'collision'):
        body = description.find("link[@name='camera_link']/" + kind)
        x, y, z = (float(value) for value in body.find('origin').get('xyz').split())
        depth, width, height = (float(value) for value in body.find('geometry/box').get('size').split())
        assert (depth, width, height) == (0.025, 0.09, 0.025) and x + depth / 2 <= 0 and y == -0.0175
        assert 0 < 0.20 + z - height / 2 - plate_m < 0.01


def test_only_camera_link_is_added_because_the_driver_publishes_the_others(jackal):
    description = jackal()
    links = [link.get('name') for link in description.findall('link')]
    children = [joint.find('child').get('link') for joint in description.findall('joint')]
    assert sorted(links) == sorted(children + ['base_link']) and len(set(links)) == len(links)
    assert [link for link in links if link.startswith('camera')] == ['camera_link']
    assert all(np.isfinite(base_from(link, description)).all() for link in links)


def test_variables_set_position_and_tilt(jackal):
    base_from_camera = base_from('camera_link', jackal(JACKAL_D435I_OFFSET='0.1 -0.05 0.4',
                                                       JACKAL_D435I_RPY='0 0.5 0'))
    np.testing.assert_allclose(base_from_camera[:3, 3], (0.1, -0.05, 0.4))
    np.testing.assert_allclose(base_from_camera[:3, 0], (np.cos(0.5), 0, -np.sin(0.5)), atol=1e-12)  # tilted down


def test_a_variable_selects_the_mesh_for_the_visual_geometry_only(jackal):
    link = jackal(JACKAL_D435I_MESH='1').find("link[@name='camera_link']")
    assert link.find('visual/geometry/mesh').get('filename') == 'package://realsense2_description/meshes/d435.dae'
    assert len(link.findall('visual')) == 1 and link.find('visual/geometry/box') is None
    assert link.find('collision/geometry/box') is not None


def test_one_command_starts_camera_and_pipeline(camera_package):
    parameters = dumped('jackal.launch', camera_package, 'weights:=/some/yolov5n.pt', 'fps:=15', 'planner:=costmap',
                        'frame_world:=odom', 'error_model:=/some/model.yaml')
    assert given_to_stand_ins(parameters)['align_depth'] == 'true'
    assert given_to_stand_ins(parameters)['color_fps'] == '15'
    assert parameters['/yolov5_node/weights'] == '/some/yolov5n.pt'
    assert parameters['/tracker_node/target_frame'] == 'odom'
    assert parameters['/planner_bridge_node/outputs'] == 'costmap'
    assert parameters['/bbox3d_node/error_model'] == parameters['/tracker_node/error_model'] == '/some/model.yaml'


@pytest.mark.parametrize('extras, arguments, expected', [
    ('', [], '0.17 0 0.20 0 0 0 base_link camera_link'),
    ('/some/arm.urdf.xacro', [], '0.17 0 0.20 0 0 0 base_link camera_link'),
    ('', ['mount:=0.1 0 0.4 0 0.5 0'], '0.1 0 0.4 0 0.5 0 base_link camera_link'),
    (CAMERA, [], None), ('', ['mount:=none'], None)])
def test_camera_mount_is_published_unless_the_description_contains_it(monkeypatch, extras, arguments, expected):
    monkeypatch.setenv('JACKAL_URDF_EXTRAS', extras)
    _parameters, nodes = loaded('jackal.launch', 'driver:=pyrealsense2', *arguments)
    assert {'realsense_node', 'yolov5_node', 'bbox3d_node', 'tracker_node'} <= set(nodes) and 'rviz' not in nodes
    assert (nodes['camera_mount'].args if 'camera_mount' in nodes else None) == expected


def test_drivers_and_mounts_of_several_cameras_are_not_started():
    parameters, nodes = loaded('jackal.launch', 'cameras:=front,rear', 'check:=true')
    assert not {'realsense_node', 'realsense2_camera', 'camera_mount'} & set(nodes)
    assert {'yolov5_node', 'bbox3d_node', 'tracker_node', 'doctor'} == set(nodes)
    assert parameters['/tracker_node/cameras'] == 'front,rear' and '/rear/bbox3d_node/estimator' in parameters


def test_nodes_are_respawned_on_the_robot_only(camera_package):
    """Elsewhere only with respawn:=true, because configuration errors would be logged repeatedly."""
    arguments = ['driver:=pyrealsense2', 'planner:=costmap']
    _parameters, nodes = loaded('jackal.launch', *arguments)
    assert len(nodes) == 6 and all(node.respawn and node.respawn_delay == 1 for node in nodes.values())
    _parameters, nodes = loaded('jackal.launch', 'respawn:=false', *arguments)
    assert not any(node.respawn for node in nodes.values())
    _parameters, nodes = loaded('pipeline.launch', 'planner:=costmap', 'weights:=yolov5n.pt')
    assert len(nodes) == 4 and not any(node.respawn for node in nodes.values())
    assert given_to_stand_ins(dumped('jackal.launch', camera_package))['respawn'] == 'true'


def test_computer_moves_the_pipeline_but_not_the_camera():
    _parameters, nodes = loaded('jackal.launch', 'driver:=pyrealsense2', 'computer:=192.168.131.20',
                                'planner:=costmap')
    remote = set(name for name, node in nodes.items() if node.machine_name == 'people')
    assert remote == {'yolov5_node', 'bbox3d_node', 'tracker_node', 'planner_bridge_node'}
    assert set(nodes) - remote == {'realsense_node', 'camera_mount'}


def test_desk_starts_rviz_or_the_viewer():
    _parameters, nodes = loaded('desk.launch', 'frame_world:=odom')
    assert set(nodes) == {'rviz'} and nodes['rviz'].args.endswith('-f odom')
    parameters, nodes = loaded('desk.launch', 'viewer:=true', 'rviz:=false', 'session:=/some/session',
                               'detector:=depth')
    assert set(nodes) == {'viewer_node'} and parameters['/viewer_node/session'] == '/some/session'
    assert dict(nodes['viewer_node'].remap_args)['detector/enable'] == 'depth_detector_node/enable'
