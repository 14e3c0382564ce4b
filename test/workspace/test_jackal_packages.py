"""Names and sizes in the packages of a Jackal are those that launch files and parameters use, and the description of
a Jackal takes the camera.
"""
import functools
import os
import xml.etree.ElementTree as ElementTree

import numpy as np
import pytest
import roslaunch
import yaml

from ros_3d_bb.pipeline.detection_stage import DepthDetectorParams
from support.jackal import described, properties, unpack
from support.launching import ROOT, loaded
from support.urdf import base_from

CAMERA = os.path.join(ROOT, 'urdf', 'jackal_d435i.urdf.xacro')


@pytest.fixture(scope='module')
def packages(tmp_path_factory):
    """Folder of the packages of a Jackal."""
    return unpack(tmp_path_factory.mktemp('packages'))


@pytest.fixture(scope='module')
def jackal(packages):
    """Description of a Jackal with the camera, as a function of environment variables."""
    return functools.partial(described, packages, JACKAL_URDF_EXTRAS=CAMERA)


@pytest.fixture(scope='module')
def content(packages):
    """Content of a YAML file of the packages, as a function of its name."""
    return lambda name: yaml.safe_load((packages / name).read_text())


def params_of_amcl(packages):
    launch_file = ElementTree.parse(str(packages / 'jackal_navigation/launch/include/amcl.launch'))
    return {param.get('name'): param.get('value') for param in launch_file.iter('param')}


def test_frames_are_those_of_filter_localisation_and_costmaps(packages, content):
    parameters, _nodes = loaded('navigation.launch')
    local_frames = [parameters['/move_base/local_costmap/' + name] for name in ('global_frame', 'robot_base_frame')]
    ekf, amcl = content('jackal_control/config/robot_localization.yaml'), params_of_amcl(packages)
    assert local_frames == [ekf['odom_frame'], ekf['base_link_frame']] and ekf['world_frame'] == ekf['odom_frame']
    assert local_frames == [amcl['odom_frame_id'], amcl['base_frame_id']]

    tracks, _nodes = loaded('jackal.launch', 'driver:=none')
    assert parameters['/move_base/global_costmap/global_frame'] == amcl['global_frame_id']
    assert tracks['/tracker_node/target_frame'] == amcl['global_frame_id']


def test_topics_are_those_of_move_base_and_twist_mux(packages, content):
    parameters, nodes = loaded('navigation.launch')
    costmap = content('jackal_navigation/params/costmap_common_params.yaml')
    scan = costmap['obstacles_layer']['scan']['topic']
    assert parameters['/move_base/local_costmap/obstacle_layer/scan/topic'] == scan
    move_base = ElementTree.parse(str(packages / 'jackal_navigation/launch/include/move_base.launch'))
    odom, = (remap.get('to') for remap in move_base.iter('remap') if remap.get('from') == 'odom')
    assert parameters['/move_base/DWAPlannerROS/odom_topic'] == odom

    inputs = {entry['name']: entry for entry in content('jackal_control/config/twist_mux.yaml')['topics']}
    external = inputs.pop('external')
    assert dict(nodes['move_base'].remap_args)['cmd_vel'] == external['topic']
    # The joystick overrides move_base.
    assert inputs and all(entry['priority'] > external['priority'] for entry in inputs.values())
    assert 1 / parameters['/move_base/controller_frequency'] < external['timeout']


@pytest.mark.parametrize('local_planner, group', [('dwa', 'DWAPlannerROS'), ('teb', 'TebLocalPlannerROS')])
def test_commands_are_within_the_limits_of_the_controller(content, local_planner, group):
    parameters, _nodes = loaded('navigation.launch', 'local_planner:=' + local_planner)
    controller = content('jackal_control/config/control.yaml')['jackal_velocity_controller']
    for axis, suffix in (('linear', 'x'), ('angular', 'theta')):
        limits, = controller[axis].values()
        assert parameters['/move_base/%s/max_vel_%s' % (group, suffix)] <= limits['max_velocity']
        assert parameters['/move_base/%s/acc_lim_%s' % (group, suffix)] <= limits['max_acceleration']
    # The controller stops the robot when commands stay away.
    assert 1 / parameters['/move_base/controller_frequency'] < controller['cmd_vel_timeout']


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


def footprint_of(parameters):
    """Half length and width of the padded footprint of the costmaps, metres."""
    corners = np.abs(parameters['/move_base/local_costmap/footprint'])
    assert (corners == corners[0]).all()
    return corners[0] + parameters['/move_base/local_costmap/footprint_padding']


def test_footprint_contains_chassis_and_wheels(packages, content):
    half = footprint_of(loaded('navigation.launch')[0])
    chassis = np.abs(content('jackal_navigation/params/costmap_common_params.yaml')['footprint'])
    size = properties(packages)
    wheels = size['wheelbase'] / 2 + size['wheel_radius'], (size['track'] + size['wheel_width']) / 2
    assert (chassis <= half).all() and (wheels <= half).all()


def test_the_floor_is_where_the_wheels_touch_it(packages):
    assert abs(DepthDetectorParams().floor_height - properties(packages)['footprint_vertical_offset']) < 1e-3


def test_the_camera_is_at_the_position_in_the_thesis(jackal):
    base_from_camera = base_from('camera_link', jackal())
    np.testing.assert_allclose(base_from_camera, [[1, 0, 0, 0.17], [0, 1, 0, 0], [0, 0, 1, 0.20], [0, 0, 0, 1]],
                               atol=1e-12)


def test_only_camera_link_is_added_because_the_driver_publishes_the_others(jackal):
    links = [link.get('name') for link in jackal().findall('link')]
    assert [link for link in links if link.startswith('camera')] == ['camera_link'] and len(set(links)) == len(links)


def test_variables_set_position_tilt_and_mesh(jackal):
    description = jackal(JACKAL_D435I_OFFSET='0.1 -0.05 0.4', JACKAL_D435I_RPY='0 0.5 0', JACKAL_D435I_MESH='1')
    assert 'd435.dae' in description.find("link[@name='camera_link']/visual/geometry/mesh").get('filename')
    base_from_camera = base_from('camera_link', description)
    np.testing.assert_allclose(base_from_camera[:3, 3], (0.1, -0.05, 0.4))
    np.testing.assert_allclose(base_from_camera[:3, 0], (np.cos(0.5), 0, -np.sin(0.5)), atol=1e-12)  # tilted down
