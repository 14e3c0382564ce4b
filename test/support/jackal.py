"""The packages of a Jackal: those of an archive in ROS_3D_BB_DATA or, without it, excerpts of them."""
import os
import re
import tarfile
import xml.etree.ElementTree as ElementTree

import xacro

from support.launching import write

ARCHIVE = os.path.join(os.environ.get('ROS_3D_BB_DATA', ''), 'gazebo', 'jackal.tar.xz')
# Excerpts of the packages: mounting links, the hook for extensions of the description, and names. Source:
# github.com/jackal/jackal (commit c6ab6ca), jackal_description, jackal_control and jackal_navigation.
DESCRIPTION = """<robot name="jackal" xmlns:xacro="http://www.ros.org/wiki/xacro">
  <link name="base_link"/> <link name="chassis_link"/> <link name="mid_mount"/> <link name="front_mount"/>
  <joint name="base_link_joint" type="fixed"><parent link="base_link"/><child link="chassis_link"/></joint>
  <joint name="mid_mount_joint" type="fixed">
    <origin xyz="0 0 0.184"/><parent link="chassis_link"/><child link="mid_mount"/>
  </joint>
  <joint name="front_mount_joint" type="fixed">
    <origin xyz="0.120 0 0"/><parent link="mid_mount"/><child link="front_mount"/>
  </joint>
  <xacro:property name="wheelbase" value="0.262"/> <xacro:property name="track" value="0.37559"/>
  <xacro:property name="wheel_radius" value="0.098"/> <xacro:property name="wheel_width" value="0.040"/>
  <xacro:property name="footprint_vertical_offset" value="-0.0655"/>
  <xacro:include filename="$(optenv JACKAL_URDF_EXTRAS empty.urdf)"/>
</robot>"""
SCAN_TOPIC = '''<launch>
  <arg name="scan_topic" default="$(eval optenv('JACKAL_LASER_TOPIC', 'front/scan'))"/></launch>'''
EXCERPTS = {
    'jackal_control/config/robot_localization.yaml':
        '{odom_frame: odom, base_link_frame: base_link, world_frame: odom, frequency: 50}',
    'jackal_control/config/control.yaml': """jackal_velocity_controller: {cmd_vel_timeout: 0.25,
        linear: {x: {max_velocity: 2.0, max_acceleration: 20.0}},
        angular: {z: {max_velocity: 4.0, max_acceleration: 25.0}}}""",
    'jackal_control/config/twist_mux.yaml': """topics:
        - {name: joy, topic: joy_teleop/cmd_vel, timeout: 0.5, priority: 10}
        - {name: bt_joy, topic: bluetooth_teleop/cmd_vel, timeout: 0.5, priority: 9}
        - {name: external, topic: cmd_vel, timeout: 0.5, priority: 1}""",
    'jackal_navigation/params/costmap_common_params.yaml': """{obstacles_layer: {scan: {topic: front/scan}},
        footprint: [[-0.21, -0.165], [-0.21, 0.165], [0.21, 0.165], [0.21, -0.165]]}""",
    'jackal_navigation/params/map_nav_params/global_costmap_params.yaml':
        '{global_costmap: {global_frame: map, robot_base_frame: base_link}}',
    'jackal_navigation/params/odom_nav_params/global_costmap_params.yaml':
        '{global_costmap: {global_frame: odom, robot_base_frame: base_link}}',
    'jackal_navigation/launch/include/move_base.launch':
        '<launch><node name="move_base"><remap from="odom" to="odometry/filtered"/></node></launch>',
    'jackal_navigation/launch/include/amcl.launch': """<launch><node name="amcl">
        <param name="odom_frame_id" value="odom"/><param name="base_frame_id" value="base_link"/>
        <param name="global_frame_id" value="map"/></node></launch>""",
    'jackal_navigation/launch/amcl_demo.launch': SCAN_TOPIC}


def unpack(folder):
    """Write the packages of a Jackal, or excerpts of them, into a folder; returns the folder that contains them."""
    if not os.path.exists(ARCHIVE):
        return _write_excerpts(folder)
    with tarfile.open(ARCHIVE) as archive:
        archive.extractall(str(folder))
    for path in folder.glob('jackal/**/*.xacro'):
        text = re.sub(r'<xacro:include filename="\$\(find (?!jackal_).*?/>', '', path.read_text())
        # xacro of PyPI finds packages of ROS 2 only.
        path.write_text(re.sub(r'\$\(find (\w+)\)', r'%s/jackal/\1' % folder, text))
    return folder / 'jackal'


def _write_excerpts(folder):
    write(folder / 'jackal_description' / 'urdf' / 'jackal.urdf.xacro', DESCRIPTION)
    for name, content in EXCERPTS.items():
        write(folder / name, content)
    return folder


def described(packages, **variables):
    """The description of a Jackal, parsed, with these environment variables."""
    before = dict(os.environ)
    os.environ.update(variables)
    try:
        path = packages / 'jackal_description' / 'urdf' / 'jackal.urdf.xacro'
        return ElementTree.fromstring(xacro.process_file(str(path)).toxml())
    finally:
        os.environ.clear()
        os.environ.update(before)


def properties(packages):
    """The numbers that jackal.urdf.xacro defines, {name: value}."""
    description = ElementTree.parse(str(packages / 'jackal_description' / 'urdf' / 'jackal.urdf.xacro'))
    return {entry.get('name'): float(entry.get('value')) for entry in description.getroot()
            if entry.tag.endswith('property')}
