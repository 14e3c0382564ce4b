"""The installed package, built with plain cmake: everything a user needs is in it, and it runs from there."""
import glob
import os
import subprocess
import sys

import pytest

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))


@pytest.fixture(scope='module')
def installed(tmp_path_factory):
    build, prefix = str(tmp_path_factory.mktemp('build')), str(tmp_path_factory.mktemp('install'))
    for command in (['cmake', ROOT, '-DCMAKE_INSTALL_PREFIX=' + prefix, '-DCATKIN_ENABLE_TESTING=OFF',
                     '-DPYTHON_EXECUTABLE=' + sys.executable], ['make', '-j2', 'install']):
        result = subprocess.run(command, cwd=build, stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
        assert result.returncode == 0, result.stdout.decode()
    return prefix


def run_in(prefix, command):
    """Run a shell command with the install space sourced and nothing else of this environment."""
    path = os.path.dirname(sys.executable) + ':/usr/bin:/bin'
    environment = {'PATH': path, 'HOME': os.path.expanduser('~'), 'ROS_HOSTNAME': 'localhost'}
    for name in ('ROS_DISTRO', 'ROS_ETC_DIR'):
        if name in os.environ:
            environment[name] = os.environ[name]
    result = subprocess.run(['bash', '-c', '. %s/setup.bash && %s' % (prefix, command)], env=environment,
                            stdout=subprocess.PIPE, stderr=subprocess.STDOUT, universal_newlines=True, cwd='/')
    assert result.returncode == 0, result.stdout
    return result.stdout


def test_launch_config_rviz_and_scripts_are_installed(installed):
    share = os.path.join(installed, 'share', 'ros_3d_bb')
    for folder in ('launch', 'config', 'rviz', 'msg', 'urdf', 'worlds'):
        assert sorted(os.listdir(os.path.join(share, folder))) == sorted(os.listdir(os.path.join(ROOT, folder)))
    scripts = [os.path.basename(path) for path in glob.glob(os.path.join(ROOT, 'scripts', '*'))] + ['annotator']
    assert sorted(os.listdir(os.path.join(installed, 'lib', 'ros_3d_bb'))) == sorted(scripts)


def test_the_package_is_found_and_imported_from_there(installed):
    assert run_in(installed, 'rospack find ros_3d_bb').strip() == os.path.join(installed, 'share', 'ros_3d_bb')
    where = run_in(installed, 'python3 -c "import ros_3d_bb.nodes.tracker_node as node; print(node.__file__)"')
    assert where.startswith(installed)


def test_the_tool_and_the_launch_files_run_from_there(installed):
    assert 'usage: session_to_bag' in run_in(installed, 'rosrun ros_3d_bb session_to_bag --help')
    assert 'usage: annotator' in run_in(installed, 'rosrun ros_3d_bb annotator --help')
    nodes = run_in(installed, 'roslaunch --nodes ros_3d_bb playback.launch bag:=x weights:=y')
    assert {'/yolov5_node', '/bbox3d_node', '/tracker_node', '/player', '/rviz'} <= set(nodes.split())
    assert installed in run_in(installed, 'roslaunch --files ros_3d_bb pipeline.launch')
