import ast
import glob
import os
import re
import subprocess
import sys
import xml.etree.ElementTree as ElementTree

import pytest
import yaml
from roslaunch.arg_dump import get_args
from roslib.packages import find_node

from ros_3d_bb.core.params import check, params_from, table_of
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


def test_roslaunch_finds_each_launch_file_by_its_name():
    """It refuses a name that two files have, wherever in the package they are."""
    names = [os.path.basename(path) for path in glob.glob(inside('**', '*.launch'), recursive=True)]
    assert len(names) > 20 and len(set(names)) == len(names)


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


def test_setup_installs_the_debian_package_of_every_ros_module():
    with open(inside('tools', 'setup.sh')) as stream:
        installed = set(stream.read().split())
    ros_modules = imported(python_files()) - set(KEYS) - {'python_qt_binding'}  # PyQt5 is used without it
    assert set('python3-' + name.replace('_', '-') for name in ros_modules) <= installed


@pytest.mark.parametrize('node', ['bbox3d_node', 'tracker_node', 'planner_bridge_node'])
def test_nodes_that_rarely_draw_images_do_not_load_opencv(node):
    code = 'import sys, ros_3d_bb.nodes.%s; sys.exit("cv2" in sys.modules)' % node
    assert subprocess.call([sys.executable, '-c', code]) == 0


@pytest.mark.parametrize('name', sorted(NODES))
def test_defaults_are_allowed_and_within_the_range_of_their_slider(name):
    kinds = node_pages.parameter_types(NODES[name].node_class)
    for kind in kinds:
        check(kind())
    for key, param in table_of(kinds).items():
        if param.live and isinstance(param.default, (int, float)) and not isinstance(param.default, bool):
            assert param.limits[0] <= param.live[0] <= param.default <= param.live[1] <= param.limits[1], key
            assert param.live[0] < param.live[1], key


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


@pytest.mark.parametrize('path, kinds', [
    item for node in NODES.values() for item in sorted(node_pages.types_in_files(node).items())])
def test_parameter_files_are_read_as_the_defaults(path, kinds):
    with open(inside(path), encoding='ascii') as stream:  # roslaunch reads it with the encoding of the locale
        given = yaml.safe_load(stream)
    assert given and [kind._asdict() for kind in params_from(given, *kinds)] == [
        {key: list(value) if key in given and isinstance(value, tuple) else value
         for key, value in kind()._asdict().items()} for kind in kinds]


@pytest.mark.parametrize('name', sorted(os.listdir(inside('launch'))))
def test_arguments_with_an_empty_default_are_called_optional(name):
    """`roslaunch --ros-args` lists them under `Required Arguments`."""
    arguments = get_args([inside('launch', name)])
    assert arguments and all((default == '') == doc.startswith('Optional. ') for doc, default in arguments.values())


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


@pytest.mark.parametrize('name, variable', [
    ('detector', ('OMP_WAIT_POLICY', 'PASSIVE')),  # waiting threads of torch leave the cores to other nodes
    ('tracker', ('OPENBLAS_NUM_THREADS', '1'))])  # small matrices need no second core
def test_nodes_use_the_cores_that_they_need(name, variable):
    """The libraries read the variables when they are loaded."""
    _parameters, nodes = loaded(name + '.launch', *REQUIRED_ARGUMENTS)
    assert nodes and all(variable in node.env_args for node in nodes.values())
