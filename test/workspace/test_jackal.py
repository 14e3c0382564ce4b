"""Camera in the description of a Jackal, and nodes of jackal.launch and desk.launch, without packages of Jackal."""
import os
import xml.etree.ElementTree as ElementTree

import numpy as np
import pytest
import xacro

from support.launching import ROOT, dumped, given_to_stand_ins, loaded, write
from support.urdf import base_from

CAMERA = os.path.join(ROOT, 'urdf', 'jackal_d435i.urdf.xacro')
# Mounting links of a Jackal, and the hook for extensions of the description. Source:
# github.com/jackal/jackal, jackal_description/urdf/jackal.urdf.xacro (commit 9978ac0).
JACKAL = """<robot name="jackal" xmlns:xacro="http://www.ros.org/wiki/xacro">
  <link name="base_link"/> <link name="chassis_link"/> <link name="mid_mount"/> <link name="front_mount"/>
  <joint name="base_link_joint" type="fixed"><parent link="base_link"/><child link="chassis_link"/></joint>
  <joint name="mid_mount_joint" type="fixed">
    <origin xyz="0 0 0.184"/><parent link="chassis_link"/><child link="mid_mount"/>
  </joint>
  <joint name="front_mount_joint" type="fixed">
    <origin xyz="0.120 0 0"/><parent link="mid_mount"/><child link="front_mount"/>
  </joint>
  <xacro:include filename="$(optenv JACKAL_URDF_EXTRAS empty.urdf)"/>
</robot>"""


@pytest.fixture
def jackal(tmp_path, monkeypatch):
    """Description of a Jackal with the camera, as a function of environment variables."""
    write(tmp_path / 'jackal.urdf.xacro', JACKAL)

    def described(**variables):
        for name, value in dict(variables, JACKAL_URDF_EXTRAS=CAMERA).items():
            monkeypatch.setenv(name, value)
        return ElementTree.fromstring(xacro.process_file(str(tmp_path / 'jackal.urdf.xacro')).toxml())
    return described


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
