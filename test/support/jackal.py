"""The packages of a Jackal: those of an archive in ROS_3D_BB_DATA or, without it, excerpts of them."""
import os
import re
import struct
import tarfile
import xml.etree.ElementTree as ElementTree

import numpy as np
import xacro

from support.launching import write
from support.urdf import base_from, parent_from_child

ARCHIVE = os.path.join(os.environ.get('ROS_3D_BB_DATA', ''), 'gazebo', 'jackal.tar.xz')
# Accessories: the environment variable that adds them, one of their links, its parent, position and mesh.
ACCESSORIES = (
    ('JACKAL_LASER', 'front_laser_mount', 'front_mount', '0 0 0', 'sick-lms1xx-upright-bracket.stl'),
    ('JACKAL_FLEA3', 'front_camera_mount', 'front_mount', '0 0 0', None),
    ('JACKAL_FRONT_ACCESSORY_FENDER', 'front_fender_accessory_link', 'front_fender_link', '0.25629 0 0.07455', None),
    ('JACKAL_WIBOTIC_BUMPER', 'wibotic_bumper', 'base_link', '0.285 0 0.07455', 'wibotic_bumper.stl'),
    ('JACKAL_ARK_ENCLOSURE', 'ark_enclosure_link', 'mid_mount', '0 0 0', 'ark_enclosure.stl'))
MESHES = {  # bounds, metres
    'jackal-fender.stl': ((0, -0.215, 0.0975), (0.2553, 0.215, 0.1497)),
    'sick-lms1xx-upright-bracket.stl': ((-0.0675, -0.069, 0), (0.0675, 0.069, 0.127)),
    'wibotic_bumper.stl': ((-0.075, -0.125, -0.015), (0.0399, 0.125, 0.13)),
    'ark_enclosure.stl': ((-0.19, -0.155, 0), (0.215, 0.155, 0.068))}
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
  <link name="front_fender_link"><visual><geometry>
    <mesh filename="package://jackal_description/meshes/jackal-fender.stl"/>
  </geometry></visual></link>
  <joint name="front_fender_joint" type="fixed"><parent link="chassis_link"/><child link="front_fender_link"/></joint>
  <xacro:property name="wheelbase" value="0.262"/> <xacro:property name="track" value="0.37559"/>
  <xacro:property name="wheel_radius" value="0.098"/> <xacro:property name="wheel_width" value="0.040"/>
  <xacro:property name="footprint_vertical_offset" value="-0.0655"/>
  %s
  <xacro:include filename="$(optenv JACKAL_URDF_EXTRAS empty.urdf)"/>
</robot>"""
ACCESSORY = """<xacro:if value="$(optenv %s 0)"><link name="%s">%s</link><joint name="%s_joint" type="fixed">
    <origin xyz="%s"/><parent link="%s"/><child link="%s"/>
  </joint></xacro:if>"""
MESH = '<visual><geometry><mesh filename="package://jackal_description/meshes/%s"/></geometry></visual>'
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
# Macros of packages that are not in the archive, with the parameters that jackal_description passes.
FOREIGN_MACROS = ''.join(
    '<xacro:macro name="%s" params="%s"><link name="${frame}"/></xacro:macro>' % macro for macro in (
        ('sick_lms1xx', 'frame topic'),
        ('pointgrey_flea3', 'frame name camera_x camera_y camera_z camera_mass hfov fps width height')))


def unpack(folder):
    """Write the packages of a Jackal, or excerpts of them, into a folder; returns the folder that contains them."""
    if not os.path.exists(ARCHIVE):
        return _write_excerpts(folder)
    with tarfile.open(ARCHIVE) as archive:
        archive.extractall(str(folder))
    for path in folder.glob('jackal/**/*.xacro'):
        text = re.sub(r'<xacro:include filename="\$\(find (?!jackal_).*?/>', '', path.read_text())
        if path.name == 'accessories.urdf.xacro':
            text = re.sub(r'(<robot .*?>)', r'\1' + FOREIGN_MACROS, text, count=1)
        # xacro of PyPI finds packages of ROS 2 only.
        path.write_text(re.sub(r'\$\(find (\w+)\)', r'%s/jackal/\1' % folder, text))
    return folder / 'jackal'


def _write_excerpts(folder):
    accessories = ''.join(ACCESSORY % (variable, link, MESH % mesh if mesh else '', link, xyz, parent, link)
                          for variable, link, parent, xyz, mesh in ACCESSORIES)
    write(folder / 'jackal_description' / 'urdf' / 'jackal.urdf.xacro', DESCRIPTION % accessories)
    for name, content in EXCERPTS.items():
        write(folder / name, content)
    meshes = folder / 'jackal_description' / 'meshes'
    meshes.mkdir()
    for name, (low, high) in MESHES.items():
        triangle = struct.pack('<12fH', *((0,) * 3 + low + high + high + (0,)))
        (meshes / name).write_bytes(bytes(80) + struct.pack('<I', 1) + triangle)
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


def bounds_of_links(description, packages):
    """Bounds of the meshes of links in base_link, {link: (low, high)}, metres."""
    bounds = {}
    for link in description.findall('link'):
        mesh = link.find('visual/geometry/mesh')
        if mesh is not None and mesh.get('filename').startswith('package://jackal_'):
            corners = _corners(packages / mesh.get('filename')[len('package://'):]) * _scale(mesh)
            base_from_mesh = base_from(link.get('name'), description).dot(parent_from_child(link.find('visual')))
            points = corners.dot(base_from_mesh[:3, :3].T) + base_from_mesh[:3, 3]
            bounds[link.get('name')] = points.min(axis=0), points.max(axis=0)
    return bounds


def _scale(mesh):
    return np.array([float(value) for value in mesh.get('scale', '1 1 1').split()])


def _corners(path):
    """The eight corners of the bounds of a binary STL file."""
    facet = np.dtype([('normal', '<f4', 3), ('vertices', '<f4', (3, 3)), ('attributes', '<u2')])
    vertices = np.frombuffer(path.read_bytes()[84:], facet)['vertices'].reshape(-1, 3).astype(float)
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    return np.array([np.where(choice, high, low) for choice in np.ndindex(2, 2, 2)])
