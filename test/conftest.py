"""Shared fixtures, and options for machines without all test dependencies.

ROS_3D_BB_DATA names a folder with data/thesis (a measurement session), weights/yolov5n.pt and
weights/yolov5n_reference.npz. Without it, the tests generate a session and a detector.
"""
import importlib.util
import os
import re
import sys

import pytest
from hypothesis import HealthCheck, settings

settings.register_profile('repeatable', derandomize=True, database=None, deadline=None,  # on a busy machine, too
                          max_examples=50, suppress_health_check=[HealthCheck.too_slow])
settings.register_profile('few', settings.get_profile('repeatable'), max_examples=20)
settings.load_profile('repeatable')
HERE = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, HERE)
from support.missing import missing_for, missing_requirements  # noqa: E402 (needs the path)
if importlib.util.find_spec('ros_3d_bb') is None:  # no workspace is sourced; unit tests need none
    sys.path.insert(0, os.path.join(os.path.dirname(HERE), 'src'))
if importlib.util.find_spec('ros_3d_bb_annotator') is None:
    sys.path.insert(0, os.path.join(os.path.dirname(HERE), 'annotator'))
DATA = os.environ.get('ROS_3D_BB_DATA', '')
NEEDS = 'needs %s, not installed'


def pytest_addoption(parser):
    parser.addoption('--leave-out', action='store_true',
                     help='skip tests that need packages of requirements.txt, or programs, that are not installed')
    parser.addoption('--long', action='store_true', help='run the tests with the marker long, and only these')


def pytest_configure(config):
    if config.getoption('--leave-out'):  # on other platforms: each function with their libraries, with fewer examples
        settings.load_profile('few')
    config.addinivalue_line('markers', 'needs(*names): modules and programs that a test needs when it runs')


def pytest_report_header(config):
    return 'ROS_3D_BB_DATA: %s' % (DATA or 'not set; the tests use generated data')


@pytest.hookimpl(hookwrapper=True)
def pytest_make_collect_report(collector):
    report = (yield).get_result()
    missing = re.search(r"No module named '(\w+)", str(report.longrepr)) if report.failed else None
    if missing and collector.config.getoption('--leave-out') and missing.group(1) in missing_requirements():
        report.outcome, report.longrepr = 'skipped', (str(collector.fspath), 0, NEEDS % missing.group(1))


def pytest_collection_modifyitems(config, items):
    gone = [item for item in items if bool(item.get_closest_marker('long')) != config.getoption('--long')]
    config.hook.pytest_deselected(items=gone)
    items[:] = [item for item in items if item not in gone]
    for item in items if config.getoption('--leave-out') else ():
        if missing_for(item):
            item.add_marker(pytest.mark.skip(NEEDS % ', '.join(sorted(missing_for(item)))))


@pytest.fixture(scope='session', autouse=True)
def own_cache(tmp_path_factory):
    """Keep networks exported by tests, and by nodes that they start, out of the user's cache."""
    os.environ['ROS_3D_BB_CACHE'] = str(tmp_path_factory.mktemp('cache'))


@pytest.fixture(scope='session')
def session_folder(tmp_path_factory):
    """A measurement session, real or synthetic."""
    if DATA:
        return os.path.join(DATA, 'data', 'thesis')
    from support.synthetic_session import write_synthetic_session
    return write_synthetic_session(str(tmp_path_factory.mktemp('session')))


@pytest.fixture(scope='session')
def weights(tmp_path_factory):
    """Weights that detect the person in `session_folder`: YOLOv5n, or a stand-in that detects red."""
    if DATA:
        return os.path.join(DATA, 'weights', 'yolov5n.pt')
    from support.red_detector import write_red_detector
    return write_red_detector(str(tmp_path_factory.mktemp('weights') / 'red.onnx'))


@pytest.fixture(scope='session')
def official_output(tmp_path_factory):
    """A checkpoint, and the output of YOLOv5's own code for given images: (path, [(image, rows, values)]).

    Without data: random weights in the official format, and a plain numpy forward pass.
    """
    from support import official_reference
    if DATA:
        return official_reference.recorded(DATA)
    return official_reference.made(str(tmp_path_factory.mktemp('reference') / 'random.pt'))


@pytest.fixture(scope='session')
def reader(tmp_path_factory):
    from support.reader import Reader
    return Reader(tmp_path_factory.mktemp('reader'))


@pytest.fixture(scope='session')
def recording(tmp_path_factory):
    from support.realsense_recordings import FRAMES, SUFFIX, colored, sloping_depth, write_recording
    path = str(tmp_path_factory.mktemp('recording') / ('a' + SUFFIX))
    return write_recording(path, [colored(number) for number in range(FRAMES)], [sloping_depth()] * FRAMES)


@pytest.fixture
def camera_package(tmp_path):
    """A folder with a stand-in for the package realsense2_camera."""
    from support.launching import RS_CAMERA_ARGUMENTS, stand_in_launch_file
    stand_in_launch_file(tmp_path, 'realsense2_camera/launch/rs_camera.launch', RS_CAMERA_ARGUMENTS)
    return tmp_path


@pytest.fixture
def window_on():
    from support.window import Driver  # imports Qt
    drivers = []

    def window_on_session(folder):
        drivers.append(Driver(folder))
        return drivers[-1]
    yield window_on_session
    for driver in drivers:
        driver.close()


@pytest.fixture
def folder(tmp_path):
    from support.small_session import write_small_session
    return write_small_session(str(tmp_path))


@pytest.fixture
def document(folder):
    from ros_3d_bb_annotator.document import Document
    return Document(folder)


@pytest.fixture
def drive(window_on, folder):
    return window_on(folder)
