"""Parameters and nodes of navigation.launch, without the planners. test/nodes/navigation.test runs it with them."""

import pytest

from support.launching import loaded

MOVE_BASE, BRIDGE = '/move_base/', '/planner_bridge_node/'


def layers_of(parameters, costmap):
    return [layer['name'] for layer in parameters[MOVE_BASE + costmap + '/plugins']]


def remappings(nodes):
    return dict(nodes['move_base'].remap_args)


def test_dwa_drives_in_a_map_with_people_in_the_local_costmap():
    parameters, nodes = loaded('navigation.launch')
    assert sorted(nodes) == ['move_base', 'planner_bridge_node']
    assert parameters[MOVE_BASE + 'base_local_planner'] == 'dwa_local_planner/DWAPlannerROS'
    assert parameters[BRIDGE + 'outputs'] == 'costmap'
    assert layers_of(parameters, 'local_costmap') == [
        'obstacle_layer', 'people_layer', 'prediction_layer']
    assert layers_of(parameters, 'global_costmap') == [
        'static_layer', 'obstacle_layer', 'people_layer', 'inflation_layer']
    assert parameters[MOVE_BASE + 'local_costmap/prediction_layer/map_topic'] == 'planner_bridge_node/costs'
    assert parameters[MOVE_BASE + 'local_costmap/rolling_window']
    assert MOVE_BASE + 'global_costmap/rolling_window' not in parameters
    assert remappings(nodes)['cmd_vel'] == 'cmd_vel'


@pytest.mark.parametrize('costmap, frame', [('local_costmap', 'my_odom'), ('global_costmap', 'my_map')])
def test_frames_and_topics_are_arguments(costmap, frame):
    parameters, nodes = loaded('navigation.launch', 'frame_world:=my_map', 'odom_frame:=my_odom',
                               'robot_frame:=my_base', 'scan_topic:=my_scan', 'odom_topic:=my_odometry',
                               'map_topic:=my_map_topic', 'cmd_vel_topic:=my_cmd_vel')
    of_costmap = MOVE_BASE + costmap
    assert parameters[of_costmap + '/global_frame'] == frame
    assert parameters[of_costmap + '/robot_base_frame'] == 'my_base'
    assert parameters[of_costmap + '/obstacle_layer/scan/topic'] == 'my_scan'
    assert parameters[MOVE_BASE + 'global_costmap/static_layer/map_topic'] == 'my_map_topic'
    assert parameters[MOVE_BASE + 'DWAPlannerROS/odom_topic'] == 'my_odometry'
    assert parameters[MOVE_BASE + 'TebLocalPlannerROS/odom_topic'] == 'my_odometry'
    assert parameters[BRIDGE + 'robot_frame'] == 'my_base' and parameters[BRIDGE + 'planner_frame'] == 'my_odom'
    assert remappings(nodes)['cmd_vel'] == 'my_cmd_vel'


def test_teb_gets_people_as_obstacles_and_only_the_ring_in_the_costmap():
    parameters, nodes = loaded('navigation.launch', 'local_planner:=teb')
    assert parameters[MOVE_BASE + 'base_local_planner'] == 'teb_local_planner/TebLocalPlannerROS'
    assert parameters[BRIDGE + 'outputs'] == 'costmap, teb'
    people_layer = MOVE_BASE + 'local_costmap/people_layer/'
    assert parameters[people_layer + 'observation_sources'] == 'clearing'
    assert parameters[people_layer + 'clearing/expected_update_rate'] == 0.5
    assert not parameters[MOVE_BASE + 'local_costmap/prediction_layer/enabled']
    assert remappings(nodes)['~TebLocalPlannerROS/obstacles'] == 'planner_bridge_node/obstacles'


@pytest.mark.parametrize('name, outputs, layers', [
    ('rolling', 'costmap', ['obstacle_layer', 'people_layer', 'inflation_layer']),
    ('social', 'costmap, people', ['static_layer', 'obstacle_layer', 'people_layer', 'proxemic_layer',
                                   'inflation_layer'])])
def test_the_global_costmap_can_have_no_map_or_a_cost_around_people(name, outputs, layers):
    parameters, _nodes = loaded('navigation.launch', 'global_costmap:=' + name)
    assert parameters[BRIDGE + 'outputs'] == outputs and layers_of(parameters, 'global_costmap') == layers


def test_a_file_of_the_user_takes_precedence(tmp_path):
    path = tmp_path / 'mine.yaml'
    path.write_text('DWAPlannerROS: {max_vel_x: 0.4}')
    bridge = tmp_path / 'bridge.yaml'
    bridge.write_text('timeout: 3.0')
    parameters, _nodes = loaded('navigation.launch', 'params:=%s' % path, 'planner_bridge_params:=%s' % bridge)
    assert parameters[BRIDGE + 'timeout'] == 3.0
    assert parameters[MOVE_BASE + 'DWAPlannerROS/max_vel_x'] == 0.4
    assert parameters[MOVE_BASE + 'DWAPlannerROS/max_vel_theta'] == 1.5


@pytest.mark.parametrize('planner', ['dwa', 'teb'])
def test_the_footprint_of_the_local_planner_and_the_costmap_is_one(planner):
    parameters, _nodes = loaded('navigation.launch', 'local_planner:=' + planner)
    footprint = parameters[MOVE_BASE + 'local_costmap/footprint']
    assert footprint == parameters[MOVE_BASE + 'global_costmap/footprint']
    if planner == 'teb':
        assert parameters[MOVE_BASE + 'TebLocalPlannerROS/footprint_model/vertices'] == footprint
