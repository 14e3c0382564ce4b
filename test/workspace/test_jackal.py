"""Nodes of jackal.launch and desk.launch, and the camera in the description of the robot."""
import os
import xml.etree.ElementTree as ElementTree

import numpy as np
import pytest
import xacro

from support.launching import JACKAL_TO_BE_EXTENDED, ROOT, dumped, given_to_stand_ins, loaded, write
from support.urdf import base_from

CAMERA = os.path.join(ROOT, 'urdf', 'jackal_d435i.urdf.xacro')


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
    assert {'realsense_node', 'people_node'} <= set(nodes) and 'rviz' not in nodes
    assert (nodes['camera_mount'].args if 'camera_mount' in nodes else None) == expected


def test_nodes_are_respawned_on_the_robot_only(camera_package):
    """Elsewhere only with respawn:=true, because configuration errors would be logged repeatedly."""
    arguments = ['driver:=pyrealsense2', 'planner:=costmap']
    _parameters, nodes = loaded('jackal.launch', *arguments)
    assert len(nodes) == 4 and all(node.respawn and node.respawn_delay == 1 for node in nodes.values())
    _parameters, nodes = loaded('jackal.launch', 'respawn:=false', *arguments)
    assert not any(node.respawn for node in nodes.values())
    _parameters, nodes = loaded('pipeline.launch', 'planner:=costmap', 'weights:=yolov5n.pt')
    assert len(nodes) == 2 and not any(node.respawn for node in nodes.values())
    assert given_to_stand_ins(dumped('jackal.launch', camera_package))['respawn'] == 'true'


def test_computer_moves_the_pipeline_but_not_the_camera():
    _parameters, nodes = loaded('jackal.launch', 'driver:=pyrealsense2', 'computer:=192.168.131.20',
                                'planner:=costmap')
    remote = set(name for name, node in nodes.items() if node.machine_name == 'people')
    assert remote == {'people_node', 'planner_bridge_node'}
    assert set(nodes) - remote == {'realsense_node', 'camera_mount'}


@pytest.fixture
def jackal(tmp_path, monkeypatch):
    """The description of a robot that includes the camera as jackal.urdf.xacro does, given environment variables."""
    write(tmp_path / 'robot.urdf.xacro', JACKAL_TO_BE_EXTENDED)

    def described(**variables):
        for name, value in dict(variables, JACKAL_URDF_EXTRAS=CAMERA).items():
            monkeypatch.setenv(name, value)
        return ElementTree.fromstring(xacro.process_file(str(tmp_path / 'robot.urdf.xacro')).toxml())
    return described


def test_the_camera_is_at_the_position_in_the_thesis(jackal):
    description = jackal()
    np.testing.assert_allclose(base_from('camera_link', description)[:3, 3], (0.17, 0, 0.20), atol=1e-12)
    assert [link.get('name') for link in description.findall('link')] == ['base_link', 'camera_link']


def test_variables_set_position_tilt_and_mesh(jackal):
    description = jackal(JACKAL_D435I_OFFSET='0.1 -0.05 0.4', JACKAL_D435I_RPY='0 0.5 0', JACKAL_D435I_MESH='1')
    base_from_camera = base_from('camera_link', description)
    np.testing.assert_allclose(base_from_camera[:3, 3], (0.1, -0.05, 0.4))
    np.testing.assert_allclose(base_from_camera[:3, 0], (np.cos(0.5), 0, -np.sin(0.5)), atol=1e-12)  # tilted down
    mesh = description.find("link[@name='camera_link']/visual/geometry/mesh")
    assert mesh.get('filename') == 'package://realsense2_description/meshes/d435.dae'
