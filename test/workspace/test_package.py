import ast
import glob
import os
import re
import xml.etree.ElementTree as ElementTree

import pytest
from roslib.packages import find_node

from ros_3d_bb.core.params import params_from, table_of
from support.launching import loaded
from support.pages import ROOT, node_pages
from support.standard_library import STANDARD_LIBRARY

# rosdep keys of modules that are no ROS packages; None: optional, imported where it is used.
KEYS = {'numpy': 'python3-numpy', 'cv2': 'python3-opencv', 'torch': 'python3-torch', 'onnxruntime': None,
        'yaml': 'python3-yaml', 'matplotlib': 'python3-matplotlib', 'scipy': 'python3-scipy',
        'norfair': None, 'trackeval': None, 'pyrealsense2': None,
        'PyQt5': None}  # part of python_qt_binding, and used without it
# What Melodic's own Python packages need on Python 3.
FOR_MELODIC = {'python3-gnupg', 'python3-pycryptodome'}
FOR_DEBIAN = {'tf2_tools'}  # which has programs of tf2_ros there
OPTIONAL = {'move_base'}  # of navigation.launch, for robots that have it
NODES = {node.name: node for node in node_pages.nodes()}
INSTALLED = 'launch', 'config', 'rviz', 'urdf', 'worlds'
REQUIRED_ARGUMENTS = ['weights:=yolov5n.pt', 'bag:=some.bag', 'session:=/some/session', 'record:=/some/record.json',
                      'camera_height:=1.2']


def inside(*parts):
    return os.path.join(ROOT, *parts)


def python_files():
    return sorted(glob.glob(inside('src', '**', '*.py'), recursive=True) + glob.glob(inside('scripts', '*'))
                  + glob.glob(inside('annotator', '**', '*.py'), recursive=True) + [inside('annotator', 'annotator')])


def declared(*kinds):
    tree = ElementTree.parse(inside('package.xml'))
    return set(element.text for kind in kinds for element in tree.iter(kind))


def imported(paths):
    names = set()
    for path in paths:
        with open(path) as stream:
            for node in ast.walk(ast.parse(stream.read())):
                if isinstance(node, ast.Import):
                    names.update(name.name.split('.')[0] for name in node.names)
                elif isinstance(node, ast.ImportFrom):
                    names.add(node.module.split('.')[0])
    return names - STANDARD_LIBRARY - {'ros_3d_bb', 'ros_3d_bb_annotator', 'ros_3d_bb_lab'}


def test_every_import_is_declared_and_every_dependency_is_used():
    needed = set(KEYS.get(name, name) for name in imported(python_files())) - {None}
    for path in glob.glob(inside('launch', '*')):
        needed.update(element.get('pkg') for element in ElementTree.parse(path).iter('node'))
    for path in glob.glob(inside('msg', '*')):
        with open(path) as stream:
            needed.update(re.findall(r'^(\w+)/', stream.read(), re.MULTILINE))
    needed -= OPTIONAL
    needed = needed - {'ros_3d_bb'} | {'message_runtime'} | FOR_MELODIC | FOR_DEBIAN
    assert declared('depend', 'exec_depend') == needed


@pytest.mark.parametrize('name', sorted(NODES))
def test_values_outside_of_the_table_are_rejected(name):
    kinds = node_pages.parameter_types(NODES[name].node_class)
    for key, param in table_of(kinds).items():
        low, high = param.limits
        outside = {bool: (), int: (low - 1, int(high) + 1), float: (low - 1e-7, high * 1.001, float('nan')),
                   str: ('nonsense',) * bool(param.choices), tuple: (['nonsense'],) * bool(param.choices)}
        for value in outside[type(param.default)]:
            with pytest.raises(ValueError, match='parameter ~%s (is|has)' % key):
                params_from({key: value}, *kinds)


# Others need packages that are not on every machine; test_launch_files.py loads them with stand-ins.
@pytest.mark.parametrize('name', sorted(set(os.listdir(inside('launch')))
                                        - {'gazebo.launch', 'jackal.launch', 'realsense.launch'}))
def test_launch_files_load_and_document_their_arguments(name):
    for argument in ElementTree.parse(inside('launch', name)).getroot().findall('arg'):
        assert argument.get('doc') or argument.get('value'), '%s: %s' % (name, argument.get('name'))
    parameters, nodes = loaded(name, *REQUIRED_ARGUMENTS)
    assert nodes
    for node in nodes.values():
        assert node.package in OPTIONAL or find_node(node.package, node.type), node.type
    for value in parameters.values():  # files, which are installed
        inner = os.path.relpath(os.path.realpath(str(value)), ROOT)
        if str(value).startswith(os.sep) and not inner.startswith(os.pardir):
            assert os.path.exists(inside(inner)) and inner.split(os.sep)[0] in INSTALLED, value
