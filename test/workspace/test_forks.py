"""What forks run on GitHub is valid by GitHub's own schema, and only what industrial_ci documents."""
import os
import subprocess
import sys

import pytest
import yaml

from support.industrial_ci_variables import HOOKS, VARIABLES

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
WORKFLOW = os.path.join(ROOT, '.github', 'workflows', 'industrial_ci.yml')


def read_workflow():
    with open(WORKFLOW, encoding='utf-8') as stream:
        return yaml.safe_load(stream)


@pytest.fixture
def job():
    return read_workflow()['jobs']['ros']


def check_schema(path):
    return subprocess.run([sys.executable, '-m', 'check_jsonschema', '--builtin-schema', 'vendor.github-workflows',
                           str(path)], stdout=subprocess.PIPE, stderr=subprocess.STDOUT)


def test_the_workflow_is_valid_by_the_schema_of_github_and_a_wrong_one_is_not(tmp_path):
    assert check_schema(WORKFLOW).returncode == 0
    workflow = read_workflow()
    workflow['jobs']['ros']['run-on'] = workflow['jobs']['ros'].pop('runs-on')
    (tmp_path / 'wrong.yml').write_text(yaml.safe_dump(workflow))
    assert check_schema(tmp_path / 'wrong.yml').returncode == 1


def test_both_of_the_robots_distributions_are_built_with_python_3(job):
    configs = job['strategy']['matrix']['config']
    assert [config['ROS_DISTRO'] for config in configs] == ['noetic', 'melodic']
    assert job['env']['CMAKE_ARGS'] == '-DPYTHON_EXECUTABLE=/usr/bin/python3'


def test_all_variables_are_those_that_industrial_ci_documents(job):
    given = set(job['env']).union(*job['strategy']['matrix']['config'])
    assert given <= VARIABLES | HOOKS


def test_what_the_matrix_hands_over_is_not_expanded_too_early(job):
    """industrial_ci's action evaluates the values of `config` in a shell before there is a container."""
    step, = (step for step in job['steps'] if step['uses'].startswith('ros-industrial/industrial_ci@'))
    assert step['with'] == {'config': '${{ toJSON(matrix.config) }}'}
    for config in job['strategy']['matrix']['config']:
        assert not any(character in value for value in config.values() for character in '$`"\\\n')


def test_commands_install_the_requirements_of_the_tests(job):
    words = job['env']['AFTER_INSTALL_TARGET_DEPENDENCIES'].replace('"', '').split()
    files = [word.replace('$TARGET_REPO_PATH', ROOT) for word in words if word.startswith('$TARGET_REPO_PATH')]
    assert [os.path.basename(path) for path in files] == ['requirements.txt', 'requirements_no_deps.txt']
    assert all(os.path.exists(path) for path in files)
    assert words.count('&&') == 1 and words[words.index('&&') + 1:][:4] == ['python3', '-m', 'pip', 'install']
