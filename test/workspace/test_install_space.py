"""The installed package, built with cmake from a copy of the sources that is deleted before anything runs."""
import glob
import os
import shutil
import subprocess
import sys

import pytest


ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
PROGRAMS = sorted(os.path.basename(path) for path in glob.glob(os.path.join(ROOT, 'scripts', '*'))) + ['annotator']
FOLDERS = ('launch', 'config', 'examples', 'rviz', 'msg', 'urdf', 'worlds')


@pytest.fixture(scope='module')
def installed(tmp_path_factory):
    prefix, source, build = (str(tmp_path_factory.mktemp(name) / 'ros_3d_bb') for name in ('prefix', 'source', 'build'))
    shutil.copytree(ROOT, source, ignore=shutil.ignore_patterns('.git', '__pycache__'))
    os.mkdir(build)
    layout = 'ON' if sys.base_prefix == '/usr' else 'OFF'  # of Debian's own Python
    for command in (['cmake', source, '-DCMAKE_INSTALL_PREFIX=' + prefix, '-DCATKIN_ENABLE_TESTING=OFF',
                     '-DPYTHON_EXECUTABLE=' + sys.executable, '-DSETUPTOOLS_DEB_LAYOUT=' + layout],
                    ['make', '-j2', 'install']):
        result = subprocess.run(command, cwd=build, stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
        assert result.returncode == 0, result.stdout.decode()
    shutil.rmtree(source)
    shutil.rmtree(build)
    return prefix


def run_in(prefix, command, *arguments):
    """Output of a shell command in the sourced install space, without this environment; fails if the command fails."""
    environment = {'PATH': os.path.dirname(sys.executable) + ':/usr/bin:/bin', 'HOME': os.path.expanduser('~'),
                   'ROS_HOSTNAME': 'localhost', 'ROS_LOG_DIR': prefix}
    environment.update({name: os.environ[name] for name in ('ROS_DISTRO', 'ROS_ETC_DIR') if name in os.environ})
    # setup.bash would read the arguments
    words = 'arguments=("$@"); set --; . %s/setup.bash && exec %s "${arguments[@]}"' % (prefix, command)
    result = subprocess.run(['bash', '-c', words, 'bash'] + [str(argument) for argument in arguments], env=environment,
                            stdout=subprocess.PIPE, stderr=subprocess.STDOUT, universal_newlines=True, cwd='/')
    assert result.returncode == 0, result.stdout
    return result.stdout


def files_in(folder):
    return sorted(os.path.relpath(os.path.join(parent, name), folder)
                  for parent, _folders, names in os.walk(folder) for name in names)


def test_launch_config_rviz_and_scripts_are_installed(installed):
    share = os.path.join(installed, 'share', 'ros_3d_bb')
    for folder in FOLDERS:
        assert files_in(os.path.join(share, folder)) == files_in(os.path.join(ROOT, folder))
    assert sorted(os.listdir(os.path.join(installed, 'lib', 'ros_3d_bb'))) == sorted(PROGRAMS)
    assert os.path.exists(os.path.join(share, 'LICENSE'))


IMPORT_ALL = """import sys
for script in sys.argv[1:]:
    exec(''.join(line for line in open(script) if line.startswith(('from ', 'import '))))"""


def test_each_script_imports_what_it_needs(installed):
    folder = os.path.join(installed, 'lib', 'ros_3d_bb')
    run_in(installed, 'python3', '-c', IMPORT_ALL, *[os.path.join(folder, name) for name in PROGRAMS])


def test_a_scene_becomes_a_bag_boxes_tracks_and_a_report(installed, tmp_path):
    scene, result, picture = tmp_path / 'scene.bag', tmp_path / 'result.bag', tmp_path / 'report.png'
    scenario = os.path.join(installed, 'share', 'ros_3d_bb', 'config', 'scenarios', 'thesis_b_moving.yaml')
    run_in(installed, 'rosrun ros_3d_bb', 'scenario_to_bag', scenario, scene, '--images', '8', '--boxes')
    run_in(installed, 'rosrun ros_3d_bb', 'process_bag', '--detector', 'none', scene, result)
    assert '8 of 8 images answered' in run_in(installed, 'rosrun ros_3d_bb', 'scene_report', result, picture)
    assert picture.exists()


def test_annotator(installed):
    assert '--analyse' in run_in(installed, 'rosrun ros_3d_bb', 'annotator', '--help')
