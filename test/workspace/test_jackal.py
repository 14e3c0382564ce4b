"""Nodes of jackal.launch. test_jackal_packages.py tests the camera in the description of the robot."""
import os

import pytest

from support.launching import ROOT, dumped, given_to_stand_ins, loaded

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
