"""The commands of the services in docker/compose.yaml. No container is run; `./run lint` checks the Dockerfile."""
import os
import re
import shlex

import yaml

from support.launching import ROOT, loaded

VARIABLE = re.compile(r'\$\{(\w+):-([^}]*)\}')


def launched(command):
    """The nodes of `roslaunch --wait ros_3d_bb FILE ARGUMENTS`."""
    program, wait, package, launch_file, *arguments = shlex.split(command)
    assert (program, wait, package) == ('roslaunch', '--wait', 'ros_3d_bb')
    return set(loaded(launch_file, *arguments)[1])


def test_commands_of_the_robot_start_its_nodes():
    with open(os.path.join(ROOT, 'docker', 'compose.yaml')) as stream:
        services = yaml.safe_load(stream)['services']
    nodes = {name: launched(VARIABLE.sub(r'\2', service['command'])) for name, service in services.items()}
    assert 'realsense_node' in nodes['camera']
    assert {'people_node', 'planner_bridge_node'} <= nodes['pipeline']
