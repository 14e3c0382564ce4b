"""What imports what: algorithms know no ROS, what runs on a robot nothing of the lab, and imports form no circle."""
import ast
import os

from support.standard_library import STANDARD_LIBRARY

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
SOURCE, ANNOTATOR = os.path.join(ROOT, 'src'), os.path.join(ROOT, 'annotator')
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


MODULES, OF_ANNOTATOR = imports_in(SOURCE), imports_in(ANNOTATOR)


def circles_in(imported):
    """The names that import each other, or lie between two that do, given the names that each one imports."""
    left = set(imported)
    while left:
        used = set().union(*(imported[name] for name in left))
        ends = {name for name in left if name not in used or not imported[name] & left}
        if not ends:
            break
        left -= ends
    return sorted(left)


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


def test_the_annotator_imports_no_ros_and_the_noise_analysis_in_one_module():
    """The noise analysis takes a second to import."""
    with_ros = tuple('ros_3d_bb.' + name for name in ('nodes', 'msg', 'conversions'))
    for module, (libraries, ours) in OF_ANNOTATOR.items():
        assert libraries <= LIBRARIES | {'PyQt5', 'python_qt_binding'}, module
        assert not any(name.startswith(with_ros) for name in ours), module
    assert [module for module, (_libraries, ours) in OF_ANNOTATOR.items()
            if any(name.startswith('ros_3d_bb_lab') for name in ours)] == ['ros_3d_bb_annotator.export']


def test_no_file_and_no_folder_imports_one_that_imports_it():
    """Imports in functions count, too."""
    files, folders = {}, {}
    for module, (_libraries, ours) in dict(MODULES, **OF_ANNOTATOR).items():
        files[module] = ours | {name.rpartition('.')[0] for name in ours}
        folders.setdefault(module.rpartition('.')[0], set()).update(
            name.rpartition('.')[0] for name in files[module] & set(MODULES))
    assert circles_in(files) == []
    assert circles_in({folder: above - {folder} for folder, above in folders.items()}) == []
