"""What imports what: algorithms know no ROS, and what runs on a robot nothing of the lab."""
import ast
import os

from support.standard_library import STANDARD_LIBRARY

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
LIBRARIES = STANDARD_LIBRARY | {'numpy', 'cv2', 'scipy', 'yaml'}  # of algorithms
ALGORITHMS = tuple('ros_3d_bb.%s.' % name for name in (
    'core', 'camera', 'estimation', 'tracking', 'detection', 'sessions', 'drivers'))
# Libraries that are slow to import or not on every machine, and the only folders that import them.
ONLY_IN = {'torch': 'ros_3d_bb.detection.yolov5.', 'onnxruntime': 'ros_3d_bb.detection.',
           'pyrealsense2': 'ros_3d_bb.drivers.', 'rospy': ('ros_3d_bb.nodes.', 'ros_3d_bb_lab.')}


def imports_in(root):
    """{module: (libraries, names of our packages that it imports)} of the modules below a folder."""
    found = {}
    for folder, _folders, names in os.walk(root):
        for path in [os.path.join(folder, name) for name in names if name.endswith('.py') and name != '__init__.py']:
            with open(path) as stream:
                nodes = list(ast.walk(ast.parse(stream.read())))
            imported = {name.name for node in nodes if isinstance(node, ast.Import) for name in node.names}
            imported.update('%s.%s' % (node.module, name.name) for node in nodes if isinstance(node, ast.ImportFrom)
                            for name in node.names)
            ours = {name for name in imported if name.startswith('ros_3d_bb')}
            module = os.path.relpath(path, root)[:-len('.py')].replace(os.sep, '.')
            found[module] = {name.split('.')[0] for name in imported - ours}, ours
    return found


MODULES = imports_in(os.path.join(ROOT, 'src'))


def test_algorithms_import_no_ros():
    assert len([module for module in MODULES if module.startswith(ALGORITHMS)]) > 50
    for module, (libraries, ours) in MODULES.items():
        if module.startswith(ALGORITHMS):
            assert libraries <= LIBRARIES | set(ONLY_IN) - {'rospy'}, module
            assert all(name.startswith(ALGORITHMS) for name in ours), module


def test_libraries_are_imported_in_their_folders_and_the_lab_by_itself():
    for module, (libraries, ours) in MODULES.items():
        assert all(module.startswith(ONLY_IN[name]) for name in libraries & set(ONLY_IN)), module
        assert module.startswith('ros_3d_bb_lab') or not any(name.startswith('ros_3d_bb_lab') for name in ours), module
