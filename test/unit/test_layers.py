"""Who may import what: pure modules know no ROS, nodes no mathematics and not each other."""
import ast
import os
import re

import pytest

from support.standard_library import STANDARD_LIBRARY

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
SOURCE, ANNOTATOR = os.path.join(ROOT, 'src', 'ros_3d_bb'), os.path.join(ROOT, 'annotator', 'ros_3d_bb_annotator')


def modules_in(root):
    return sorted(os.path.relpath(os.path.join(folder, name), root)
                  for folder, _folders, names in os.walk(root) for name in names if name.endswith('.py'))


MODULES = modules_in(SOURCE)
PURE_LIBRARIES = {'numpy', 'cv2', 'torch', 'onnxruntime', 'yaml', 'matplotlib', 'scipy', 'norfair', 'trackeval',
                  'pyrealsense2'}
# desk tools: no node may come to need their libraries
NOISE, TRACKING_BENCHMARK = os.path.join('evaluation', 'noise'), os.path.join('evaluation', 'tracking')
ORIGINAL = 'ros_3d_bb_lab.evaluation.baselines.original_tracker'  # needs none of those libraries
SPEED_PICTURE = os.path.join('evaluation', 'speed_picture.py')  # of a benchmark, which imports it last
ASSIGNMENT = os.path.join('tracking', 'association.py')  # SciPy's solver has no equal
# know ROS messages, bags and transforms, but neither nodes nor topics nor a master
ROS_TYPES = {'bag_processing.py', 'bag_reading.py', 'bag_transforms.py', 'bags.py', 'camera_messages.py',
             'following.py', 'lifting.py', 'markers.py', 'messages.py', 'pipeline.py', 'planner_messages.py',
             'process_bag.py', 'report.py', 'searching.py', 'simulator_messages.py',
             os.path.join('diagnosis', 'bag_look.py'), os.path.join('diagnosis', 'observing.py'),
             os.path.join('diagnosis', 'roles.py')}

# what a session is, without the windows that show it
WITHOUT_WINDOW = {'__init__.py', 'analysis.py', 'command_line.py', 'document.py', 'drafts.py', 'entries.py',
                  'export.py', 'legacy.py', 'lengths.py', 'measurement.py', 'validation.py'}
QT = {'PyQt5', 'python_qt_binding'}


def imports_of(module, root=SOURCE):
    """Top-level names of other packages, and dotted names of ours, that a module imports."""
    with open(os.path.join(root, module)) as stream:
        tree = ast.parse(stream.read())
    names = [name.name for node in ast.walk(tree) if isinstance(node, ast.Import) for name in node.names]
    names += [node.module for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)]
    ours = set(name for name in names if name.startswith('ros_3d_bb'))
    return set(name.split('.')[0] for name in names) - {'ros_3d_bb'}, ours


def test_there_is_something_to_check():
    assert len(MODULES) > 15 and 'nodes/bbox3d_node.py' in MODULES


@pytest.mark.parametrize('module', [m for m in MODULES if not m.startswith('nodes/') and m not in ROS_TYPES])
def test_pure_modules_know_no_ros(module):
    others, ours = imports_of(module)
    assert others <= PURE_LIBRARIES | STANDARD_LIBRARY
    assert not any(name.startswith(('ros_3d_bb.nodes', 'ros_3d_bb.msg', 'ros_3d_bb.conversions.perception_msgs'))
                   for name in ours)


@pytest.mark.parametrize('module', MODULES)
def test_rospy_is_for_nodes_torch_for_detection_and_scipy_for_desk_tools(module):
    others, ours = imports_of(module)
    assert 'rospy' not in others or module.startswith('nodes/')
    assert 'torch' not in others or module.startswith('detection/')
    assert 'matplotlib' not in others or module.startswith(NOISE) or module == SPEED_PICTURE
    assert 'scipy' not in others or module.startswith((NOISE, TRACKING_BENCHMARK)) or module == ASSIGNMENT
    assert 'pyrealsense2' not in others or module == 'realsense.py'
    assert not others & {'norfair', 'trackeval'} or module.startswith(TRACKING_BENCHMARK)
    for tool in (NOISE, TRACKING_BENCHMARK):
        name = 'ros_3d_bb.' + tool.replace(os.sep, '.')
        assert not any(our.startswith(name) for our in ours - {ORIGINAL}) or module.startswith(tool)


@pytest.mark.parametrize('module', [m for m in MODULES if m.startswith(TRACKING_BENCHMARK)])
def test_libraries_of_the_tracking_benchmark_are_imported_where_they_are_used(module):
    with open(os.path.join(SOURCE, module)) as stream:
        assert not re.search(r'^(import|from) (norfair|trackeval)', stream.read(), re.MULTILINE)


@pytest.mark.parametrize('module', [m for m in MODULES if m.startswith('nodes/')])
def test_nodes_know_no_mathematics_and_not_each_other(module):
    others, ours = imports_of(module)
    assert not others & {'numpy', 'math', 'cv2', 'torch'}
    assert not any(name.endswith('_node') for name in ours)


@pytest.mark.parametrize('module', modules_in(ANNOTATOR))
def test_the_annotator_knows_no_ros_and_only_its_windows_qt(module):
    others, ours = imports_of(module, ANNOTATOR)
    allowed = STANDARD_LIBRARY | {'numpy', 'cv2', 'ros_3d_bb_annotator'}
    assert others <= allowed | (set() if module in WITHOUT_WINDOW else QT)
    assert not any(name.startswith(('ros_3d_bb.nodes', 'ros_3d_bb.msg', 'ros_3d_bb.conversions.perception_msgs'))
                   for name in ours)
    noise = any(name.startswith('ros_3d_bb_lab.evaluation.noise') for name in ours)
    assert not noise or module == 'analysis.py'  # it takes a second to import


def test_the_modules_without_windows_are_there():
    assert WITHOUT_WINDOW <= set(modules_in(ANNOTATOR))


@pytest.mark.parametrize('module', sorted(WITHOUT_WINDOW - {'command_line.py'}))
def test_modules_without_windows_import_none_with(module):
    _others, ours = imports_of(module, ANNOTATOR)
    own = set(name.split('.')[1] + '.py' for name in ours if name.startswith('ros_3d_bb_annotator.'))
    assert own <= WITHOUT_WINDOW
