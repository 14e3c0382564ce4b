"""The parameters and nodes of launch files, with stand-ins for packages that are not on every machine."""
import os
import subprocess
import sys

import roslaunch
import yaml

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
# The arguments that rs_camera.launch of realsense2_camera 2.3.2, the last one for ROS 1, declares. Source:
# github.com/IntelRealSense/realsense-ros, realsense2_camera/launch/rs_camera.launch (commit 00d4d13, and
# wait_for_device_timeout, which 2.3.2 added).
RS_CAMERA_ARGUMENTS = tuple('''
    serial_no usb_port_id device_type json_file_path camera tf_prefix external_manager manager output respawn
    fisheye_width fisheye_height enable_fisheye depth_width depth_height enable_depth
    confidence_width confidence_height enable_confidence confidence_fps
    infra_width infra_height enable_infra enable_infra1 enable_infra2 infra_rgb
    color_width color_height enable_color fisheye_fps depth_fps infra_fps color_fps gyro_fps accel_fps
    enable_gyro enable_accel enable_pointcloud pointcloud_texture_stream pointcloud_texture_index
    allow_no_texture_points ordered_pc enable_sync align_depth publish_tf tf_publish_rate
    filters clip_distance linear_accel_cov initial_reset reconnect_timeout wait_for_device_timeout
    unite_imu_method topic_odom_in calib_odom_file publish_odom_tf
    stereo_module/exposure/1 stereo_module/gain/1 stereo_module/exposure/2 stereo_module/gain/2'''.split())
# A robot that includes the camera as jackal.urdf.xacro does.
JACKAL_TO_BE_EXTENDED = """<robot name="jackal" xmlns:xacro="http://www.ros.org/wiki/xacro">
  <link name="base_link"/>
  <xacro:include filename="$(optenv JACKAL_URDF_EXTRAS empty.urdf)"/>
</robot>"""
# The arguments that the launch files of gazebo_ros 2.9 and jackal_gazebo 0.4 declare.
GAZEBO_ARGUMENTS = {
    'gazebo_ros/launch/empty_world.launch': ('paused', 'use_sim_time', 'extra_gazebo_args', 'gui', 'headless', 'debug',
                                             'physics', 'verbose', 'world_name', 'enable_ros_network'),
    'jackal_gazebo/launch/spawn_jackal.launch': ('x', 'y', 'z', 'yaw', 'joystick', 'config')}


def write(path, text):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)


def stand_in_launch_file(folder, name, arguments, more=''):
    """A launch file `package/...` that copies its arguments into parameters /stub/NAME; `more` may use them."""
    lines = ['<arg name="%s" default=""/><param name="/stub/%s" type="str" value="$(arg %s)"/>' % ((arg,) * 3)
             for arg in arguments]
    write(folder / name, '<launch>%s%s</launch>' % (''.join(lines), more))
    write_package(folder, name.split('/')[0])


def write_package(folder, name):
    write(folder / name / 'package.xml', '<package format="2"><name>%s</name></package>' % name)


def stand_in_gazebo(folder):
    for name, arguments in GAZEBO_ARGUMENTS.items():
        stand_in_launch_file(folder, name, arguments, '<param name="robot_description" value="bare"/>')
    write(folder / 'jackal_description' / 'urdf' / 'jackal.urdf.xacro', JACKAL_TO_BE_EXTENDED)
    write(folder / 'xacro' / 'xacro', '#!%s\nimport xacro\nxacro.main()\n' % sys.executable)
    (folder / 'xacro' / 'xacro').chmod(0o755)
    write_package(folder, 'jackal_description')
    write_package(folder, 'xacro')


def dumped(launch_file, packages, *arguments, **environment):
    """The parameters that roslaunch would set; packages in the folder `packages` precede all others."""
    path = '%s:%s:%s' % (packages, ROOT, os.environ.get('ROS_PACKAGE_PATH', ''))
    command = [sys.executable, '-c', 'import roslaunch; roslaunch.main()', '--dump-params',
               os.path.join(ROOT, 'launch', launch_file)] + list(arguments)
    return yaml.safe_load(subprocess.check_output(command, env=dict(os.environ, ROS_PACKAGE_PATH=path, **environment)))


def given_to_stand_ins(parameters):
    return {key[len('/stub/'):]: value for key, value in parameters.items() if key.startswith('/stub/') and value}


def loaded(launch_file, *arguments):
    loader, config = roslaunch.xmlloader.XmlLoader(resolve_anon=False), roslaunch.config.ROSLaunchConfig()
    loader.load(os.path.join(ROOT, 'launch', launch_file), config, argv=list(arguments), verbose=False)
    return ({name: parameter.value for name, parameter in config.params.items()},
            {node.name: node for node in config.nodes})
