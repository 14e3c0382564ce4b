"""What realsense.launch starts, with a stand-in for realsense2_camera that has only the arguments of its release."""
from support.launching import dumped, given_to_stand_ins, loaded


def test_the_driver_aligns_depth_to_colour_of_the_same_size_and_rate(camera_package):
    """The stand-in rejects arguments that are not those of the release."""
    given = given_to_stand_ins(dumped('realsense.launch', camera_package))
    assert given == {'align_depth': 'true', 'camera': 'camera', 'initial_reset': 'false', 'color_width': '640',
                     'color_height': '480', 'color_fps': '30', 'depth_width': '640', 'depth_height': '480',
                     'depth_fps': '30', 'respawn': 'false'}
    given = given_to_stand_ins(dumped('realsense.launch', camera_package, 'camera:=front', 'serial_no:=0123', 'fps:=15',
                                      'width:=848', 'initial_reset:=true'))
    assert given['camera'] == 'front' and given['initial_reset'] == 'true'
    assert (given['color_width'], given['depth_width'], given['color_fps'], given['depth_fps']) == (
        '848', '848', '15', '15')
    assert given['serial_no'].lstrip('0') == '123'


def test_exposure_is_automatic_or_in_the_units_of_the_sensor(camera_package):
    automatic = dumped('realsense.launch', camera_package)
    assert automatic['/camera/rgb_camera/enable_auto_exposure'] is True
    assert automatic['/camera/rgb_camera/auto_exposure_priority'] is False
    assert '/camera/rgb_camera/exposure' not in automatic
    fixed = dumped('realsense.launch', camera_package, 'exposure:=0.008', 'camera:=front')
    assert fixed['/front/rgb_camera/enable_auto_exposure'] is False and fixed['/front/rgb_camera/exposure'] == 80


def test_without_the_driver_our_node_reads_the_camera_with_the_same_names():
    parameters, nodes = loaded('realsense.launch', 'driver:=pyrealsense2', 'camera:=front', 'width:=848', 'fps:=15',
                               'exposure:=0.008')
    assert set(nodes) == {'front_realsense_node'} and '/use_sim_time' not in parameters
    expected = {'frame_prefix': 'front', 'width': 848, 'height': 480, 'fps': 15, 'exposure': 0.008,
                'file': '', 'publish_clock': False}
    assert {name: parameters['/front_realsense_node/' + name] for name in expected} == expected
    assert dict(nodes['front_realsense_node'].remap_args) == {'camera/' + topic: 'front/' + topic for topic in (
        'color/image_raw', 'color/camera_info', 'aligned_depth_to_color/image_raw',
        'aligned_depth_to_color/camera_info')}


def test_a_recording_is_played_by_our_node_with_its_own_time():
    parameters, nodes = loaded('realsense.launch', 'file:=/some/where.bag', 'repeat:=true')
    assert set(nodes) == {'realsense_node'} and parameters['/use_sim_time'] is True
    assert parameters['/realsense_node/file'] == '/some/where.bag' and parameters['/realsense_node/repeat'] is True
    assert parameters['/realsense_node/publish_clock'] is True
