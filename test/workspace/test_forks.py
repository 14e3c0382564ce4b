"""The GitHub workflows for forks conform to GitHub's schema and to the documented variables of industrial_ci."""
import os
import re
import subprocess
import sys

import pytest
import yaml

from support.industrial_ci_variables import HOOKS, VARIABLES

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
WORKFLOW = os.path.join(ROOT, '.github', 'workflows', 'industrial_ci.yml')
SITE_WORKFLOW = os.path.join(ROOT, '.github', 'workflows', 'site.yml')


@pytest.fixture
def job():
    with open(WORKFLOW, encoding='utf-8') as stream:
        return yaml.safe_load(stream)['jobs']['ros']


@pytest.mark.needs('check_jsonschema')
def test_workflows_conform_to_the_schema_of_github():
    subprocess.check_call([sys.executable, '-m', 'check_jsonschema', '--builtin-schema', 'vendor.github-workflows',
                           WORKFLOW, SITE_WORKFLOW])


def test_the_site_is_published_with_the_versions_that_are_tested():
    with open(SITE_WORKFLOW, encoding='utf-8') as stream, \
            open(os.path.join(ROOT, 'test', 'requirements.txt'), encoding='utf-8') as requirements:
        tested, pinned = requirements.read(), re.findall(r'[\w-]+==[\d.]+', stream.read())
    assert len(pinned) == 3 and all('\n%s;' % version in tested for version in pinned)


def test_only_documented_variables_of_industrial_ci_are_set(job):
    assert set(job['env']).union(*job['strategy']['matrix']['config']) <= VARIABLES | HOOKS


def test_values_of_the_matrix_are_not_expanded_too_early(job):
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
