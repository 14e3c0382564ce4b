"""Generated pages and files agree with the code; so do README, doc/ and package.xml. test_readme.py runs commands."""
import ast
import contextlib
import glob
import os
import re
import shlex
import subprocess
import sys
import xml.etree.ElementTree as ElementTree
from unittest import mock

import pytest
from roslib.packages import find_node

from ros_3d_bb.core.object_classes import COCO
from ros_3d_bb.core.params import params_from, table_of
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.core.yaml_loader import load_yaml
from ros_3d_bb.nodes.people_node import PeopleNode
from ros_3d_bb.nodes.realsense_node import RealSenseNode
from ros_3d_bb.planning.planner_outputs import NAMES
from ros_3d_bb_lab.simulation.ros.simulator_node import SimulatorNode
from support.code_blocks import BLOCKS, PAGES, ROOT
from support.inputs import TARGETS, Blind, send_image
from support.launching import loaded
from support.masterless import masterless
from support.planner_definitions import package
from support.standard_library import STANDARD_LIBRARY

DOC = os.path.join(ROOT, 'doc')
sys.path.insert(0, DOC)
import node_pages  # noqa: E402 (needs the path)

CONFIG = node_pages.config_files()
NODES = {node.name: node for node in node_pages.nodes()}
USED = set(name for name, node in NODES.items() if 'evaluation' not in node.node_class.__module__)  # not by benchmarks
SCENARIO = os.path.join(ROOT, 'config', 'scenarios', 'empty_room.yaml')
# Parameters with which nodes connect to all their topics; the other nodes are created as `TARGETS`.
MORE_PARAMS = {'planner_bridge_node': {'outputs': ', '.join(NAMES)},
               'tracker_node': {'use_map': True}, 'speed_limit_node': {'use_scan': True},
               'realsense_node': {'publish_clock': True},
               'simulator_node': {'scenario': SCENARIO, 'drive': True, 'boxes': True, 'supervised': True}}
OTHERS = {'realsense_node': RealSenseNode, 'simulator_node': SimulatorNode, 'people_node': PeopleNode}
OPTIONAL_PACKAGES = 'people_msgs', 'costmap_converter', 'derived_object_msgs', 'vision_msgs'


@contextlib.contextmanager
def connected(name):
    """A node that has received images and boxes of one stamp, and its connections; no thread runs."""
    stand_ins = {optional + '.msg': package(optional) for optional in OPTIONAL_PACKAGES}
    if name in OTHERS:
        params, make = {}, OTHERS[name]
    else:
        params, make = TARGETS[name].params, TARGETS[name].make
    with masterless(dict(params, **MORE_PARAMS.get(name, {}))) as connections, \
            mock.patch.dict(sys.modules, stand_ins), mock.patch('threading.Thread.start'):
        node = make()
        send_image(connections, NS)
        yield node, connections


def documented(name, section):
    return {entry.name: entry.kind for entry in NODES[name].sections.get(section, ())}


def test_each_node_has_a_script():
    scripts = set(name for name in os.listdir(os.path.join(ROOT, 'scripts')) if name.endswith('_node'))
    assert set(NODES) == scripts and USED == set(name.split()[0] for name in TARGETS) | set(OTHERS)


@pytest.mark.parametrize('path', sorted(CONFIG))
def test_parameter_files_are_up_to_date(path):
    file = os.path.join(ROOT, path)
    assert os.path.exists(file), 'missing; write it with ./run config'
    with open(file, encoding='utf-8') as stream:
        assert stream.read() == CONFIG[path], 'outdated; write it with ./run config'


@pytest.mark.parametrize('name', [pytest.param(name, marks=pytest.mark.needs('pyrealsense2'))
                                  if name == 'realsense_node' else name
                                  for name in sorted(USED - {'people_node'})])  # which connects as its parts do
def test_a_node_connects_to_the_topics_and_services_of_its_docstring(name):
    with connected(name) as (_node, connections):
        for section, found in (('Subscribes', connections.subscribers), ('Publishes', connections.publishers)):
            # the node resolves the name of a topic in the namespace of another one
            # images are subscribed with any type, see `subscribers.subscribe`
            types = {topic.lstrip('/'): connection.kind._type.replace('*', 'sensor_msgs/Image')
                     for topic, connection in found.items()}
            assert types == {topic.lstrip('/'): kind for topic, kind in documented(name, section).items()}
        assert {service: kind._type for service, kind in connections.services.items()} == documented(name, 'Services')


@pytest.mark.slow
@pytest.mark.needs('sphinx')
def test_the_site_has_every_page_and_each_link_has_a_target(tmp_path):
    """Others are errors of Sphinx. The checkout keeps its files and their times."""
    def state():
        return {path: os.stat(path).st_mtime_ns for folder in (DOC, os.path.join(ROOT, 'config'))
                for path in glob.glob(os.path.join(folder, '**'), recursive=True) if '__pycache__' not in path}
    before, sources = state(), str(tmp_path / 'sources')
    node_pages.write_sources(sources)
    subprocess.check_call([sys.executable, '-m', 'sphinx', '-W', '--keep-going', '-n', '-q', '-b', 'html', '-d',
                           str(tmp_path / 'trees'), '-c', sources + '/doc', sources, str(tmp_path / 'html')])
    assert state() == before
    for path in ('index', 'nodes/tracker_node'):
        assert (tmp_path / 'html' / 'doc' / (path + '.html')).exists()


def text_of(path):
    with open(os.path.join(ROOT, path), encoding='utf-8') as stream:
        return stream.read()


def prose_of(page):
    return re.sub(r'^```.*?^```$', '', text_of(page), flags=re.DOTALL | re.MULTILINE)


@pytest.mark.parametrize('page', PAGES)
def test_named_files_and_launch_arguments_exist(page):
    known = set(argument.get('name') for path in glob.glob(os.path.join(ROOT, 'launch', '*'))
                for argument in ElementTree.parse(path).iter('arg'))
    for code in re.findall(r'`([^`\n]+)`', prose_of(page)):
        for path in re.findall(r'(?:^|\s)((?:config|doc|launch|msg|rviz|src|test|urdf|worlds)/[\w./]*\w)$', code):
            assert glob.glob(os.path.join(ROOT, path)), path
        if ' ' not in code and not code.startswith('-'):
            assert set(re.findall(r'\b([a-z]\w*):=', code)) - known == set(), code


def types_of(name):
    """The types of the parameters of a node, which may depend on the detector."""
    node, detector = NODES[name.split()[0]], TARGETS[name].params.get('detector')
    if detector:
        return node_pages.types_in_files(node)['config/%s.yaml' % detector]
    return node_pages.parameter_types(node.node_class)


PARAMETERS = {name: table_of(types_of(name)) for name in TARGETS}


def accepts(name, values):
    with masterless(dict(TARGETS[name].params, **values)), mock.patch.object(Blind, 'names', COCO + ['wheelchair']):
        return TARGETS[name].make() is not None


def examples_in_files():
    """(node, text that stands in its parameter file): examples in comments, in the prose and in blocks of the pages."""
    for name, table in PARAMETERS.items():
        for parameter, param in table.items():
            for example in re.findall(r'such as (\[.*\])', param.text):
                yield name, '%s: %s' % (parameter, example)
    texts = [text for page in PAGES for text in re.findall(r'`(\w+: [^`\n]+)`', prose_of(page))]
    texts += [block.text for block in BLOCKS if block.language == 'yaml']
    for text in sorted(set(texts)):
        for name in sorted(PARAMETERS):
            if set(re.findall(r'^(\w+):', text, re.MULTILINE)) <= set(PARAMETERS[name]) and '/absolute' not in text:
                yield name, text


@pytest.mark.parametrize('name, text', examples_in_files())
def test_examples_of_parameters_can_be_written_to_the_file_of_the_node(name, text):
    assert accepts(name, load_yaml(text))


@pytest.mark.parametrize('name, given', [given for page in PAGES for given in re.findall(
    r'dynparam set +/(\w+) +([^`\n]+)', text_of(page).replace('\\\n', ''))])
def test_examples_of_live_parameters_are_accepted(name, given):
    """`dynparam` converts them to the type of the parameter; lists have the type text."""
    words = shlex.split(given)
    values = {words[0]: words[1]} if len(words) == 2 else load_yaml(words[0])
    name = next(each for each in PARAMETERS if each.split()[0] == name and set(values) <= set(PARAMETERS[each]))
    kinds = {parameter: type(PARAMETERS[name][parameter].default) for parameter in values}
    assert all(PARAMETERS[name][parameter].live for parameter in values)
    assert accepts(name, {parameter: value if kinds[parameter] is tuple else kinds[parameter](value)
                          for parameter, value in values.items()})


@pytest.mark.parametrize('page', PAGES)
def test_launch_files_have_the_arguments_of_commands(page):
    """roslaunch refuses others."""
    commands = text_of(page).replace('\\\n', '')  # which may continue on the next line
    for name, given in re.findall(r'roslaunch (?:--\S+ )?ros_3d_bb ([a-z]\w*\.launch)(.*)', commands):
        arguments = ElementTree.parse(os.path.join(ROOT, 'launch', name)).getroot().findall('arg')
        settable = set(argument.get('name') for argument in arguments if argument.get('value') is None)
        assert set(re.findall(r'\b(\w+):=', given)) <= settable, (name, given)


# rosdep keys of modules that are no ROS packages; None: optional, imported where it is used.
KEYS = {'numpy': 'python3-numpy', 'cv2': 'python3-opencv', 'torch': 'python3-torch', 'onnxruntime': None,
        'yaml': 'python3-yaml', 'matplotlib': 'python3-matplotlib', 'scipy': 'python3-scipy',
        'norfair': None, 'trackeval': None, 'pyrealsense2': None,
        'PyQt5': None}  # part of python_qt_binding, and used without it
# What Melodic's own Python packages need on Python 3.
FOR_MELODIC = {'python3-gnupg', 'python3-pycryptodome'}
FOR_DEBIAN = {'tf2_tools'}  # which has programs of tf2_ros there
OPTIONAL = {'move_base'}  # of navigation.launch, for robots that have it
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
