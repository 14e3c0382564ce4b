"""Where the tests find real data, and what they make themselves where there is none.

ROS_3D_BB_DATA names a folder with data/thesis (a measurement session), weights/yolov5n.pt and
weights/yolov5n_reference.npz. Without it each test runs on a session and a detector that the package makes.
"""
import importlib.util
import os
import sys

import pytest
from hypothesis import settings

settings.register_profile('repeatable', derandomize=True, database=None, deadline=None)
settings.load_profile('repeatable')
HERE = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, HERE)
from support.missing import imports_when_loaded, misses_something, missing_requirements  # noqa: E402 (found there)
if importlib.util.find_spec('ros_3d_bb') is None:  # no workspace is sourced: the pure modules need none
    sys.path.insert(0, os.path.join(os.path.dirname(HERE), 'src'))
if importlib.util.find_spec('ros_3d_bb_annotator') is None:
    sys.path.insert(0, os.path.join(os.path.dirname(HERE), 'annotator'))
DATA = os.environ.get('ROS_3D_BB_DATA', '')


def pytest_addoption(parser):
    parser.addoption('--leave-out', action='store_true', help='leave out the tests that need packages of '
                     'requirements.txt that are not installed, instead of failing there')


def left_out(config):
    """Modules whose tests are left out: none, unless that was asked for."""
    return missing_requirements() if config.getoption('--leave-out') else set()


def pytest_configure(config):
    config.addinivalue_line('markers', 'needs(*modules): modules that a test needs later than its file is imported')


def pytest_report_header(config):
    data = 'ROS_3D_BB_DATA: %s' % (DATA or 'not set; the tests use data that they make themselves')
    return [data] + ['left out: what needs ' + ', '.join(sorted(left_out(config)))] * bool(left_out(config))


def pytest_ignore_collect(path, config):
    """Whether a file cannot even be imported."""
    return bool(path.basename.startswith('test_') and imports_when_loaded(str(path)) & left_out(config)) or None


def pytest_collection_modifyitems(config, items):
    """Leave out single tests."""
    gone = [item for item in items if config.getoption('--leave-out') and misses_something(item)]
    config.hook.pytest_deselected(items=gone)
    items[:] = [item for item in items if item not in gone]


@pytest.fixture(scope='session', autouse=True)
def own_cache(tmp_path_factory):
    """Exported networks of the tests, and of the nodes that they start, do not go into the user's cache."""
    os.environ['ROS_3D_BB_CACHE'] = str(tmp_path_factory.mktemp('cache'))


@pytest.fixture(scope='session')
def session_folder(tmp_path_factory):
    """A measurement session: the real one, or a synthetic one."""
    if DATA:
        return os.path.join(DATA, 'data', 'thesis')
    from support.synthetic_session import write_synthetic_session
    return write_synthetic_session(str(tmp_path_factory.mktemp('session')))


@pytest.fixture(scope='session')
def weights(tmp_path_factory):
    """Weights that find the person in `session_folder`: YOLOv5n, or a stand-in that looks for red."""
    if DATA:
        return os.path.join(DATA, 'weights', 'yolov5n.pt')
    from support.red_detector import write_red_detector
    return write_red_detector(str(tmp_path_factory.mktemp('weights') / 'red.torchscript'))


@pytest.fixture(scope='session')
def official_output(tmp_path_factory):
    """A checkpoint, and what YOLOv5's own code says to given images: (path, [(image, rows, values)]).

    Without the real one: a checkpoint of random weights in the official form, and a plain numpy forward pass.
    """
    from support import official_reference
    if DATA:
        return official_reference.recorded(DATA)
    return official_reference.made(str(tmp_path_factory.mktemp('reference') / 'random.pt'))


@pytest.fixture(scope='session')
def reader(tmp_path_factory, weights):
    """Somebody who types what the README tells."""
    from support.reader import Reader
    reader = Reader(tmp_path_factory.mktemp('reader'), weights)
    yield reader
    reader.leave()


@pytest.fixture(scope='session')
def camera_bag(session_folder, tmp_path_factory):
    """A bag at 2 Hz of a camera before which somebody stands, with 2D boxes; it lasts while a detector starts."""
    from ros_3d_bb.bags.bag_writer import SessionBagOptions, session_images, write_bag
    from ros_3d_bb.sessions.session_reader import read_session
    session = read_session(session_folder)
    nearest = sorted(session.frames, key=lambda frame: abs(frame.truth_m[1] - 2.4) + abs(frame.truth_m[0]))
    path = str(tmp_path_factory.mktemp('camera') / 'camera.bag')
    write_bag(session_images(session._replace(frames=nearest[:5] * 8), SessionBagOptions(2.0, with_boxes=True)), path)
    return path


@pytest.fixture
def window_on():
    """Opens the annotator's window on the session in a folder; the windows are closed at the end."""
    from support.window import Driver  # Qt, which few tests need
    drivers = []

    def window_on_session(folder):
        drivers.append(Driver(folder))
        return drivers[-1]
    yield window_on_session
    for driver in drivers:
        driver.close()


@pytest.fixture
def folder(tmp_path):
    """A small measurement session, to be annotated."""
    from support.small_session import write_small_session
    return write_small_session(str(tmp_path))


@pytest.fixture
def document(folder):
    """It, opened."""
    from ros_3d_bb_annotator.document import Document
    return Document.open(folder)


@pytest.fixture
def drive(window_on, folder):
    """The annotator's window on it."""
    return window_on(folder)
