"""The container: sources of its image, its commands, and those of doc/container.md. No container is run.

`./run lint` checks the Dockerfile.
"""
import os
import re
import shlex
import subprocess

import pytest
import yaml

from support.code_blocks import ROOT, claimed
from support.launching import loaded

COMPOSE = os.path.join(ROOT, 'docker', 'compose.yaml')
BLOCKS = [claimed('docker ' + beginning) for beginning in (
    'build ', 'run --init --name demo', 'run --rm --init -e DISPLAY', 'run --rm --user', 'compose -f')]
VARIABLE = re.compile(r'\$\{(\w+):-([^}]*)\}')
# A docker that names its arguments, one on a line, and the variables for docker/compose.yaml.
DOCKER = '#!/bin/sh\nprintf "%s\\n" "$@"\nenv | grep ^PIPELINE= || true\n'


@pytest.fixture
def services():
    with open(COMPOSE) as stream:
        return yaml.safe_load(stream)['services']


def run_block(block, folder):
    """What a stand-in for docker receives, as lines."""
    (folder / 'docker').write_text(DOCKER)
    (folder / 'docker').chmod(0o755)
    environment = dict(os.environ, PATH='%s:%s' % (folder, os.environ['PATH']), HOME='/home/reader', DISPLAY=':0')
    return subprocess.check_output(['bash', '-euc', block.text], cwd=ROOT, env=environment).decode().splitlines()


def launched(command):
    """The nodes of `roslaunch --wait ros_3d_bb FILE ARGUMENTS`."""
    program, wait, package, launch_file, *arguments = shlex.split(command)
    assert (program, wait, package) == ('roslaunch', '--wait', 'ros_3d_bb')
    return set(loaded(launch_file, *arguments)[1])


def test_commands_of_the_robot_start_its_nodes(services):
    nodes = {name: launched(VARIABLE.sub(r'\2', service['command'])) for name, service in services.items()}
    assert 'realsense_node' in nodes['camera']
    assert {'people_node', 'planner_bridge_node'} <= nodes['pipeline']


@pytest.mark.parametrize('block', BLOCKS, ids=lambda block: str(block.line))
def test_blocks_of_the_page_name_files_that_exist_and_the_image(block, services, tmp_path):
    given = run_block(block, tmp_path)
    files = [given[number + 1] for number, word in enumerate(given) if word == '-f']
    assert all(os.path.isfile(os.path.join(ROOT, name)) for name in files)
    assert 'ros_3d_bb' in given or os.path.relpath(COMPOSE, ROOT) in files
    for pipeline in (line[len('PIPELINE='):] for line in given if line.startswith('PIPELINE=')):
        assert 'people_node' in launched(services['pipeline']['command'].split('$')[0] + pipeline)
