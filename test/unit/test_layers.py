import ast
import functools
import os

import pytest

from support.standard_library import STANDARD_LIBRARY

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
SOURCE, ANNOTATOR = os.path.join(ROOT, 'src'), os.path.join(ROOT, 'annotator', 'ros_3d_bb_annotator')

# folder: (folders that it may import, libraries beside numpy and Python's own); each folder imports itself.
# `core` is ros_3d_bb.core, `lab.evaluation` is ros_3d_bb_lab.evaluation, `msg` the generated messages; `messages` and
# `ros` are the sets of libraries below.
ALLOWED = {
    'ros_3d_bb.core': ('', 'yaml'),
    'ros_3d_bb.camera': ('core', 'cv2'),
    'ros_3d_bb.estimation': ('camera core', 'yaml'),
    'ros_3d_bb.tracking': ('camera core', 'scipy'),
    'ros_3d_bb.detection': ('core', 'cv2'),
    'ros_3d_bb.detection.onnx': ('core detection', 'onnxruntime yaml'),
    'ros_3d_bb.detection.yolov5': ('core detection detection.onnx', 'onnxruntime torch'),
    'ros_3d_bb.detection.depth': ('core detection', 'cv2'),
    'ros_3d_bb.conversions': ('camera core estimation msg tracking', 'cv2 messages'),
    'ros_3d_bb.planning': ('camera conversions core tracking', 'messages'),
    'ros_3d_bb.visualization': ('camera core estimation tracking', 'cv2 messages'),
    'ros_3d_bb.sessions': ('camera core detection estimation', 'cv2'),
    'ros_3d_bb.drivers': ('camera core', 'pyrealsense2'),
    'ros_3d_bb.pipeline': (
        'camera conversions core detection detection.depth detection.yolov5 estimation tracking visualization',
        'messages tf2_ros'),
    'ros_3d_bb.bags': (
        'camera conversions core detection.yolov5 estimation pipeline sessions', 'messages rosbag tf2_ros yaml'),
    'ros_3d_bb.diagnosis': ('bags camera conversions core detection.depth msg pipeline', 'messages tf2_ros yaml'),
    'ros_3d_bb.nodes.common': ('camera conversions core diagnosis msg pipeline planning visualization', 'ros'),
    'ros_3d_bb.nodes': (
        'bags camera conversions core detection detection.depth detection.yolov5 diagnosis drivers msg nodes.common '
        'pipeline planning sessions tracking visualization', 'ros'),
    'ros_3d_bb_lab.simulation': ('camera core tracking', 'cv2 yaml'),
    'ros_3d_bb_lab.simulation.ros': ('bags camera conversions core msg nodes.common lab.simulation', 'ros'),
    'ros_3d_bb_lab.evaluation.baselines': ('camera core tracking', 'norfair'),
    'ros_3d_bb_lab.evaluation': (
        'camera core detection detection.depth detection.yolov5 estimation sessions tracking '
        'lab.evaluation.baselines lab.simulation', 'cv2 matplotlib'),
    'ros_3d_bb_lab.evaluation.noise': (
        'camera core estimation sessions tracking lab.evaluation lab.evaluation.tracking', 'matplotlib scipy'),
    'ros_3d_bb_lab.evaluation.tracking': (
        'camera core estimation tracking lab.evaluation lab.evaluation.baselines', 'scipy trackeval'),
    'ros_3d_bb_lab.evaluation.video': (
        'camera core detection detection.depth tracking visualization lab.evaluation lab.evaluation.baselines '
        'lab.evaluation.tracking lab.simulation', 'cv2'),
    'ros_3d_bb_lab.evaluation.demo': (
        'conversions core tracking visualization lab.evaluation lab.simulation.ros', 'matplotlib rosbag'),
    'ros_3d_bb_lab.evaluation.navigation': (
        'camera conversions core msg nodes.common tracking lab.evaluation lab.simulation lab.simulation.ros',
        'ros yaml'),
    'ros_3d_bb_lab.evaluation.gazebo': (
        'bags conversions core tracking lab.evaluation lab.simulation', 'messages rosbag'),
    'ros_3d_bb_lab.evaluation.latency': ('bags conversions core msg nodes.common lab.evaluation', 'ros')}
MESSAGES = set('genpy actionlib_msgs diagnostic_msgs geometry_msgs nav_msgs rosgraph_msgs sensor_msgs std_msgs '
               'std_srvs tf2_msgs visualization_msgs'.split())
SETS = {'messages': MESSAGES, 'ros': MESSAGES | set(
    'dynamic_reconfigure rosgraph roslib rospkg rospy tf2_ros'.split())}
QT = {'PyQt5', 'python_qt_binding'}


def modules_in(root):
    return sorted(os.path.relpath(os.path.join(folder, name), root)[:-len('.py')].replace(os.sep, '.')
                  for folder, _folders, names in os.walk(root) for name in names if name.endswith('.py'))


MODULES = [module for module in modules_in(SOURCE) if not module.endswith('.__init__')]


@functools.lru_cache(maxsize=None)
def imports_of(module, root=SOURCE):
    """Top-level names of other packages, and dotted names of ours, that a module imports."""
    with open(os.path.join(root, *module.split('.')) + '.py') as stream:
        tree = ast.parse(stream.read())
    names = [name.name for node in ast.walk(tree) if isinstance(node, ast.Import) for name in node.names]
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom):
            names += ['%s.%s' % (node.module, name.name) for name in node.names]
    ours = set(name for name in names if name.startswith('ros_3d_bb'))
    return set(name.split('.')[0] for name in names if name not in ours), ours


def full(name):
    return 'ros_3d_bb_' + name if name.startswith('lab') else 'ros_3d_bb.' + name


def folder_of(name):
    """The folder of ALLOWED, or the package of messages, that a dotted name lies in; None for a package itself."""
    parts = name.split('.')
    for count in range(len(parts), 1, -1):
        folder = '.'.join(parts[:count])
        if folder in ALLOWED or folder == 'ros_3d_bb.msg':
            return folder
    return None


def cycles_in(imported):
    """The names that import each other, or lie between two that do, given the set of names that each one imports."""
    left = set(imported)
    while left:
        used = set().union(*(imported[name] for name in left))
        ends = set(name for name in left if name not in used or not imported[name] & left)
        if not ends:
            break
        left -= ends
    return sorted(left)


def lies_in(name, package):
    return name == package or name.startswith(package + '.')


def test_each_module_lies_in_a_folder_of_the_table():
    assert set(folder_of(module) for module in MODULES) == set(ALLOWED)
    assert 'ros_3d_bb.nodes.bbox3d_node' in MODULES


@pytest.mark.parametrize('module', MODULES)
def test_modules_import_what_their_folder_may(module):
    folder = folder_of(module)
    folders, libraries = ALLOWED[folder]
    others, ours = imports_of(module)
    allowed = set().union(*(SETS.get(library, {library}) for library in libraries.split()))
    assert others <= STANDARD_LIBRARY | {'numpy'} | allowed
    assert set(map(folder_of, ours)) <= set(map(full, folders.split())) | {folder, None}


def test_no_folder_imports_one_that_imports_it():
    below = {folder: set(map(full, folders.split())) - {'ros_3d_bb.msg'} for folder, (folders, _) in ALLOWED.items()}
    for folder, imported in below.items():  # the robot's packages import nothing of the lab
        assert lies_in(folder, 'ros_3d_bb_lab') or not any(lies_in(name, 'ros_3d_bb_lab') for name in imported)
    assert cycles_in(below) == []


@pytest.mark.parametrize('root, package', [(SOURCE, ''), (ANNOTATOR, 'ros_3d_bb_annotator.')],
                         ids=['package', 'annotator'])
def test_no_file_imports_one_that_imports_it(root, package):
    """Imports in functions count, too."""
    below = {}
    for module in modules_in(root):
        _others, ours = imports_of(module, root)
        below[package + module] = ours | set(name.rsplit('.', 1)[0] for name in ours)
    assert len(below) > 5 and cycles_in(below) == []


def test_the_annotator_imports_no_ros_and_the_noise_analysis_in_one_module():
    """The noise analysis takes a second to import."""
    with_ros = 'ros_3d_bb.nodes', 'ros_3d_bb.msg', 'ros_3d_bb.conversions'
    of_the_lab = []
    for module in modules_in(ANNOTATOR):
        others, ours = imports_of(module, ANNOTATOR)
        assert others <= STANDARD_LIBRARY | {'numpy', 'cv2'} | QT, module
        assert not any(lies_in(name, package) for name in ours for package in with_ros), module
        of_the_lab += [module] * any(lies_in(name, 'ros_3d_bb_lab') for name in ours)
    assert of_the_lab == ['export']
