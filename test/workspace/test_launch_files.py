"""Parameters, nodes and topics that launch files set for their arguments, with stand-ins for realsense2_camera.

test_pages.py loads each launch file, test_camera_mount.py those with the pose of a camera. test/nodes/navigation.test
runs navigation.launch with the planners.
"""
import ast
import glob
import os
import shlex
from xml.etree import ElementTree

import pytest

from ros_3d_bb.conversions.camera_msgs import COLOR_TOPIC, DEPTH_TOPICS, INFO_TOPICS
from support.code_blocks import BLOCKS
from support.launching import ROOT, dumped, given_to_stand_ins, loaded

JACKAL_CAMERA = os.path.join(ROOT, 'urdf', 'jackal_d435i.urdf.xacro')
MEASURE = 'measure.launch session:="/a session" weights:=/some.pt '
OWN_DRIVER = 'realsense.launch driver:=pyrealsense2 '
LOCAL, GLOBAL = '/move_base/local_costmap/', '/move_base/global_costmap/'
OF_USER = ('navigation.launch frame_world:=my_map odom_frame:=my_odom robot_frame:=my_base scan_topic:=my_scan '
           'odom_topic:=my_odometry map_topic:=my_map_topic cmd_vel_topic:=my_cmd_vel')
MOUNT = '0.17 0 0.20 0 0 0 base_link camera_link'
ON_ROBOT = 'jackal.launch driver:=pyrealsense2 planner:=costmap '
ROBOT_NODES = ['camera_mount', 'people_node', 'planner_bridge_node', 'realsense_node']
# A command, and what it sets: parameters, `nodes`, those that are `respawned`, `TYPE:TOPIC` for a
# remapping, and `COSTMAP layers`.
CASES = [
    (MEASURE, {'nodes': ['people_node', 'viewer_node'], '/viewer_node/session': '/a session',
               '/viewer_node/window': True, '/tracker_node/target_frame': 'map'}),
    (OWN_DRIVER + 'width:=848 fps:=15 exposure:=0.008', {
        'nodes': ['realsense_node'], '/use_sim_time': None, '/realsense_node/frame_prefix': 'camera',
        '/realsense_node/width': 848, '/realsense_node/height': 480, '/realsense_node/fps': 15,
        '/realsense_node/exposure': 0.008, '/realsense_node/publish_clock': False}),
    (OWN_DRIVER + 'camera:=front', {
        'nodes': ['front_realsense_node'], '/front_realsense_node/frame_prefix': 'front',
        'realsense_node:camera/color/image_raw': 'front/color/image_raw',
        'realsense_node:camera/color/camera_info': 'front/color/camera_info',
        'realsense_node:camera/aligned_depth_to_color/image_raw': 'front/aligned_depth_to_color/image_raw',
        'realsense_node:camera/aligned_depth_to_color/camera_info': 'front/aligned_depth_to_color/camera_info'}),
    ('realsense.launch file:=/some/where.bag repeat:=true', {
        'nodes': ['realsense_node'], '/use_sim_time': True, '/realsense_node/file': '/some/where.bag',
        '/realsense_node/repeat': True, '/realsense_node/publish_clock': True}),
    ('navigation.launch', {
        'nodes': ['move_base', 'planner_bridge_node'], 'move_base:cmd_vel': 'cmd_vel',
        '/move_base/base_local_planner': 'dwa_local_planner/DWAPlannerROS', '/planner_bridge_node/outputs': 'costmap',
        'local layers': ['obstacle_layer', 'people_layer', 'prediction_layer'],
        'global layers': ['static_layer', 'obstacle_layer', 'people_layer', 'inflation_layer'],
        LOCAL + 'prediction_layer/map_topic': 'planner_bridge_node/costs', LOCAL + 'rolling_window': True,
        GLOBAL + 'rolling_window': None, LOCAL + 'global_frame': 'odom', GLOBAL + 'global_frame': 'map',
        LOCAL + 'robot_base_frame': 'base_link', LOCAL + 'obstacle_layer/scan/topic': 'front/scan',
        '/move_base/DWAPlannerROS/odom_topic': 'odometry/filtered'}),  # the names of a Jackal
    (OF_USER, {
        LOCAL + 'global_frame': 'my_odom', GLOBAL + 'global_frame': 'my_map', LOCAL + 'robot_base_frame': 'my_base',
        GLOBAL + 'robot_base_frame': 'my_base', LOCAL + 'obstacle_layer/scan/topic': 'my_scan',
        GLOBAL + 'obstacle_layer/scan/topic': 'my_scan', GLOBAL + 'static_layer/map_topic': 'my_map_topic',
        '/move_base/DWAPlannerROS/odom_topic': 'my_odometry', '/move_base/TebLocalPlannerROS/odom_topic': 'my_odometry',
        '/planner_bridge_node/robot_frame': 'my_base', '/planner_bridge_node/planner_frame': 'my_odom',
        'move_base:cmd_vel': 'my_cmd_vel'}),
    ('navigation.launch local_planner:=teb', {  # people are its obstacles; the costmap has only the ring
        '/move_base/base_local_planner': 'teb_local_planner/TebLocalPlannerROS',
        '/planner_bridge_node/outputs': 'costmap, teb', LOCAL + 'people_layer/observation_sources': 'clearing',
        LOCAL + 'people_layer/clearing/expected_update_rate': 0.5, LOCAL + 'prediction_layer/enabled': False,
        'move_base:~TebLocalPlannerROS/obstacles': 'planner_bridge_node/obstacles'}),
    ('navigation.launch global_costmap:=social', {
        '/planner_bridge_node/outputs': 'costmap, people',
        'global layers': ['static_layer', 'obstacle_layer', 'people_layer', 'proxemic_layer', 'inflation_layer']}),
    ('pipeline.launch detector:=depth depth:=raw rviz:=true cameras:="front, rear"', {
        '/front/detector_node/depth': 'raw', '/rear/bbox3d_node/depth': 'raw', '/tracker_node/depth': 'raw',
        '/tracker_node/cameras': 'front, rear', 'rviz:yolo_result_out': 'front/yolo_result_out',
        'bbox3d_node:camera/depth/image_rect_raw': 'depth/image_rect_raw',  # in the namespace of its camera
        'tracker_node:camera/depth/image_rect_raw': 'camera/depth/image_rect_raw'}),
    ('pipeline.launch weights:=/some.pt floor_frame:=none', {
        '/bbox3d_node/floor_frame': '', '/detector_node/floor_frame': ''}),
    ('playback.launch bag:=/b.bag detector:=depth camera_pose:=floor image_rotation:=90', {
        '/camera_pose_node/frame_world': 'map', '/camera_pose_node/image_rotation': '90',
        '/bbox3d_node/floor_frame': 'map', '/detector_node/floor_frame': 'map',
        '/detector_node/floor_height': 0, '/tracker_node/target_frame': 'map'}),
    ('simulation.launch rviz:=false error_model:=none', {
        '/bbox3d_node/floor_frame': 'base_link', '/bbox3d_node/error_model': None, '/tracker_node/error_model': None}),
    (ON_ROBOT, {'nodes': ROBOT_NODES, 'respawned': ROBOT_NODES}),
    (ON_ROBOT + 'respawn:=false', {'respawned': []}),
    ('pipeline.launch planner:=costmap weights:=yolov5n.pt', {'respawned': []})]  # errors would be logged repeatedly


@pytest.mark.parametrize('command, expected', CASES, ids=[command for command, _expected in CASES])
def test_arguments_set_parameters_nodes_and_topics(command, expected):
    found, nodes = loaded(*shlex.split(command))
    found['nodes'] = sorted(nodes)
    found['respawned'] = sorted(name for name, node in nodes.items() if node.respawn)
    for node in nodes.values():
        found.update(('%s:%s' % (node.type, topic), target) for topic, target in node.remap_args)
    for costmap in ('local', 'global'):
        layers = found.get('/move_base/%s_costmap/plugins' % costmap, [])
        found[costmap + ' layers'] = [layer['name'] for layer in layers]
    assert {key: found.get(key) for key in expected} == expected


@pytest.mark.parametrize('cameras, prefixes', [('', ['']), ('front, rear', ['front/', 'rear/'])])
def test_recorded_outputs_do_not_mix_with_the_current_ones(cameras, prefixes):
    _parameters, nodes = loaded('playback.launch', 'bag:=/b.bag', 'detector:=depth', 'cameras:=' + cameras)
    remapped = dict(nodes['player'].remap_args + [each.split(':=') for each in nodes['player'].args.split()
                                                  if ':=' in each])
    topics = ['yolo_bounding_box', 'yolo_result_out', 'ros_3d_bb/bb_3d']
    topics += ['ros_3d_bb/' + image for image in ('color', 'raw', 'depth')]
    outputs = [prefix + topic for prefix in prefixes for topic in topics]
    outputs += ['ros_3d_bb/tracks', 'visualization_marker_array', '/diagnostics']
    expected = {topic: 'recorded/' + topic.lstrip('/') for topic in outputs}
    assert remapped == dict(expected, clock='/clock')  # which rosbag publishes in its namespace


def test_expressions_assign_no_name_which_roslaunch_of_melodic_rejects():
    """In Python 2, a list comprehension assigns in the scope of the expression; a generator does not."""
    for path in glob.glob(os.path.join(ROOT, 'launch', '*.launch')):
        values = [value for tag in ElementTree.parse(path).iter() for value in tag.attrib.values()]
        for value in values:
            if value.startswith('$(eval '):
                nodes = ast.walk(ast.parse(value[len('$(eval '):-1], mode='eval'))
                assert not any(isinstance(node, ast.ListComp) for node in nodes), (path, value)


def test_files_of_the_user_take_precedence(tmp_path):
    for name, content in (('mine', 'DWAPlannerROS: {max_vel_x: 0.4}'), ('bridge', 'timeout: 3.0')):
        (tmp_path / name).write_text(content)
    parameters, _nodes = loaded('navigation.launch', 'params:=%s' % (tmp_path / 'mine'),
                                'planner_bridge_params:=%s' % (tmp_path / 'bridge'))
    assert parameters['/planner_bridge_node/timeout'] == 3.0
    assert parameters['/move_base/DWAPlannerROS/max_vel_x'] == 0.4
    assert parameters['/move_base/DWAPlannerROS/max_vel_theta'] == 1.5


# With a stand-in for the driver, which rejects arguments that are not those of the release.
WITH_DRIVER = [
    ('realsense.launch camera:=front serial_no:=0123 fps:=15 width:=848 initial_reset:=true exposure:=0.008', {
        '/stub/camera': 'front', '/stub/initial_reset': 'true', '/stub/color_width': '848', '/stub/depth_width': '848',
        '/stub/color_fps': '15', '/stub/depth_fps': '15', '/front/rgb_camera/enable_auto_exposure': False,
        '/front/rgb_camera/exposure': 80}),  # in units of the sensor
    ('measure.launch camera:=true detector:=depth session:=/a', {
        '/stub/align_depth': 'true', '/tracker_node/target_frame': 'camera_link',
        '/detector_node/floor_frame': ''}),
    ('jackal.launch weights:=/some/yolov5n.pt fps:=15 planner:=costmap frame_world:=odom error_model:=/model.yaml', {
        '/stub/align_depth': 'true', '/stub/color_fps': '15', '/stub/respawn': 'true',
        '/detector_node/weights': '/some/yolov5n.pt', '/tracker_node/target_frame': 'odom',
        '/planner_bridge_node/outputs': 'costmap', '/bbox3d_node/error_model': '/model.yaml',
        '/tracker_node/error_model': '/model.yaml'})]


@pytest.mark.parametrize('command, expected', WITH_DRIVER)
def test_arguments_are_given_to_the_driver(camera_package, command, expected):
    name, *arguments = command.split()
    parameters = dumped(name, camera_package, *arguments)
    assert {key: parameters.get(key) for key in expected} == expected
    assert 'serial_no' not in command or parameters['/stub/serial_no'].lstrip('0') == '123'


def test_the_driver_aligns_depth_to_colour_of_the_same_size_and_rate(camera_package):
    parameters = dumped('realsense.launch', camera_package)
    assert given_to_stand_ins(parameters) == {
        'align_depth': 'true', 'camera': 'camera', 'initial_reset': 'false', 'color_width': '640',
        'color_height': '480', 'color_fps': '30', 'depth_width': '640', 'depth_height': '480', 'depth_fps': '30',
        'respawn': 'false'}
    assert parameters['/camera/rgb_camera/enable_auto_exposure'] is True
    assert parameters['/camera/rgb_camera/auto_exposure_priority'] is False


@pytest.mark.parametrize('extras, arguments, expected', [
    ('/some/arm.urdf.xacro', [], MOUNT),
    ('', ['mount:=0.1 0 0.4 0 0.5 0'], '0.1 0 0.4 0 0.5 0 base_link camera_link'),
    (JACKAL_CAMERA, [], None), ('', ['mount:=none'], None)])
def test_camera_mount_is_published_unless_the_description_contains_it(monkeypatch, extras, arguments, expected):
    monkeypatch.setenv('JACKAL_URDF_EXTRAS', extras)
    _parameters, nodes = loaded('jackal.launch', 'driver:=pyrealsense2', *arguments)
    assert (nodes['camera_mount'].args if 'camera_mount' in nodes else None) == expected


RECIPES = [block.text for block in BLOCKS if block.page == 'doc/other_cameras.md' and 'camera_depth:=' in block.text
           and block.text.startswith('roslaunch')]


@pytest.mark.parametrize('recipe', RECIPES)
def test_launch_files_use_the_topics_of_a_recipe(recipe):
    arguments = shlex.split(recipe.replace('\\\n', ''))[3:]
    nodes = loaded('pipeline.launch', *arguments)[1]
    nodes.update(loaded('pipeline.launch', 'single_process:=false', *arguments)[1])
    given = dict(argument.split(':=') for argument in arguments)
    color, info, depth = (given['camera_' + name] for name in ('image', 'info', 'depth'))
    depth_topic = DEPTH_TOPICS[given.get('depth', 'aligned')][0]
    everything = {COLOR_TOPIC: color, INFO_TOPICS[0]: info, depth_topic: depth}
    for node, topics in (('people_node', everything), ('bbox3d_node', everything),
                         ('detector_node', {COLOR_TOPIC: color}),
                         ('tracker_node', {INFO_TOPICS[0]: info, depth_topic: depth})):
        remaps = dict(nodes[node].remap_args)
        assert {topic: remaps[topic] for topic in topics} == topics
