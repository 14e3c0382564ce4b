"""Runs the commands of the README as a user types them, with stand-ins for what a test machine does not have."""
import contextlib
import os
import shutil
import subprocess
import sys
import tempfile
import time
from hashlib import sha1
from unittest import mock

import rosgraph

from ros_3d_bb_lab.evaluation.launching import free_port, running
from support.code_blocks import ROOT
from support.launching import RS_CAMERA_ARGUMENTS, stand_in_launch_file, write
from support.screen import start_screen

SUPPORT = os.path.join(ROOT, 'test', 'support')
PATIENCE_S = 120  # on a busy machine
# A driver publishes the camera's frames below camera_link, and no frames of the robot.
CAMERA_DRIVER = """
<node pkg="ros_3d_bb" type="replay_node" name="$(arg camera)_realsense">
  <param name="bag" value="$(env READER_BAG)"/> <param name="rate" value="5"/> <remap from="/tf" to="not_a_driver"/>
  <remap from="camera/color/image_raw" to="$(arg camera)/color/image_raw"/>
  <remap from="camera/color/camera_info" to="$(arg camera)/color/camera_info"/>
  <remap from="camera/aligned_depth_to_color/image_raw" to="$(arg camera)/aligned_depth_to_color/image_raw"/>
</node>
<node pkg="tf2_ros" type="static_transform_publisher" name="$(arg camera)_frames"
      args="0 0 0 -0.5 0.5 -0.5 0.5 $(arg camera)_link $(arg camera)_color_optical_frame"/>"""


class Reader(object):
    """Runs blocks of code in a shell in a home folder below `folder`, an empty pathlib.Path."""

    def __init__(self, folder):
        self.home, self.clone, self.etc = folder / 'home', folder / 'home' / 'ros_3d_bb', folder / 'etc'
        self.log, self.cache, self._display = folder / 'log.txt', folder / 'cache', None
        for path in (self.home / 'catkin_ws' / 'src', self.etc, self.clone):
            path.mkdir(parents=True)
        self.log.write_text('')
        for name in set(os.listdir(ROOT)) - {'config', '.git'}:
            os.symlink(os.path.join(ROOT, name), str(self.clone / name))
        shutil.copytree(os.path.join(ROOT, 'config'), str(self.clone / 'config'))
        self._put_stand_ins(folder / 'packages')
        self._environment = dict(
            os.environ, HOME=str(self.home), USER='reader', READER_LOG=str(self.log), READER_BAG='',
            READER_CLONE=str(self.clone), ROS_3D_BB_CACHE=str(self.cache), ROS_LOG_DIR=str(folder / 'ros_log'),
            ROS_PACKAGE_PATH='%s:%s' % (folder / 'packages', os.environ['ROS_PACKAGE_PATH']), ROS_HOSTNAME='localhost')
        for name in ('DISPLAY', 'ROS_IP'):
            self._environment.pop(name, None)

    def _put_stand_ins(self, packages):
        """Packages that a test machine does not have, and the virtual environment that `run` would make."""
        stand_in_launch_file(packages, 'realsense2_camera/launch/rs_camera.launch', RS_CAMERA_ARGUMENTS, CAMERA_DRIVER)
        python = self.cache / 'venv' / 'bin' / 'python3'
        write(python, '#!/bin/sh\nexec %s "$@"\n' % sys.executable)
        python.chmod(0o755)
        wanted = b''.join(open(os.path.join(ROOT, 'test', name), 'rb').read()
                          for name in ('requirements.txt', 'requirements_no_deps.txt'))
        (self.cache / 'venv' / 'installed').write_text('%s  -\n' % sha1(wanted).hexdigest())  # the format of sha1sum

    def typed(self, block):
        text = block.text.replace('/opt/ros/noetic/', '%s/' % self.etc)
        return '. %s/stand_ins/reader.sh\n%s' % (SUPPORT, text)

    def types(self, block, at, **environment):
        """Run a block that ends by itself in a folder. Returns its output; fails if a command fails."""
        result = subprocess.run(['bash', '-euo', 'pipefail', '-c', self.typed(block)], cwd=str(at),
                                env=dict(self._environment, **environment), stdin=subprocess.DEVNULL,
                                stdout=subprocess.PIPE, stderr=subprocess.STDOUT, universal_newlines=True)
        assert result.returncode == 0, '%s:%d\n%s' % (block.page, block.line, result.stdout)
        return result.stdout

    @contextlib.contextmanager
    def running(self, block, **environment):
        """Run a block until Ctrl-C. Yields a Graph, and ends it."""
        environment = dict(self._environment, ROS_MASTER_URI='http://localhost:%d' % free_port(), **environment)
        with contextlib.ExitStack() as processes:
            graph = Graph(environment, processes)
            graph.start(['bash', '-c', self.typed(block)], cwd=str(self.home))
            yield graph

    def screen(self):
        if self._display is None:
            with mock.patch.dict(os.environ):
                start_screen()
                self._display = os.environ['DISPLAY']
        return self._display


class Graph(object):
    """Processes on one ROS master, which an ExitStack ends, and their output."""

    def __init__(self, environment, processes):
        self.environment, self._processes, self._first = environment, processes, None
        self._output = processes.enter_context(tempfile.NamedTemporaryFile())

    def start(self, command, **options):
        process = self._processes.enter_context(running(
            command, env=self.environment, stdin=subprocess.DEVNULL, stdout=self._output, stderr=subprocess.STDOUT,
            **options))
        self._first = self._first or process

    def output(self):
        with open(self._output.name, errors='replace') as stream:
            return stream.read()

    def _has_master(self):
        return rosgraph.is_master_online(self.environment['ROS_MASTER_URI'])

    def hears(self, *wanted):
        """Wait for a message on each of these topics ('topic', or 'topic:field that is not empty')."""
        self.waits(self._has_master, 'a master')
        for topic, _colon, field in (each.partition(':') for each in wanted):
            condition = ['--filter', 'm.' + field] if field else []
            status = subprocess.call(['timeout', str(PATIENCE_S), 'rostopic', 'echo', '--noarr', '-n', '1', topic]
                                     + condition, env=self.environment, stdout=subprocess.DEVNULL)
            assert status == 0, 'nothing on %s\n%s' % (topic, self.output())

    def shows(self, title):
        self.waits(lambda: subprocess.call(['xdotool', 'search', '--onlyvisible', '--name', title],
                                           env=self.environment, stdout=subprocess.DEVNULL) == 0, 'window ' + title)

    def waits(self, condition, what):
        """Wait for a condition; fail after PATIENCE_S, or when the first process ends."""
        deadline_s = time.monotonic() + PATIENCE_S
        while not condition():
            assert time.monotonic() < deadline_s and self._first.poll() is None, (
                'timeout: %s\n%s' % (what, self.output()))
            time.sleep(0.1)
