"""The arguments of ./run. Nothing is installed or built."""
import os
import subprocess

import pytest

RUN = os.path.join(os.path.dirname(os.path.abspath(__file__)), os.pardir, os.pardir, 'run')


def run(*arguments):
    result = subprocess.run(['bash', RUN] + list(arguments), stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
                            stderr=subprocess.PIPE, universal_newlines=True)
    return result.returncode, result.stdout, result.stderr


@pytest.mark.parametrize('arguments', [(), ('help',), ('--help',)] + [
    (command, '--help') for command in ('demo', 'test', 'gazebo', 'lint', 'setup', 'build', 'planners', 'soak', 'doc')])
def test_help_starts_nothing(arguments):
    status, printed, errors = run(*arguments)
    assert status == 0 and printed.startswith('usage: ./run') and not errors


@pytest.mark.parametrize('arguments', [
    ('tset',), ('test', '--quick'), ('test', '--fast', 'x'), ('test', '--platform'), ('test', '--platform', 'kinetic'),
    ('test', 'missing.py'), ('test', '-k'), ('build', 'x'), ('config', 'x'), ('lint', '--all'),
    ('planners', 'x'), ('doc', '--theme'), ('doc', 'site', 'x'),
    ('demo', '--fast'), ('demo', 'missing'), ('demo', 'rate:=fast'), ('demo', 'weights:=missing.pt')])
def test_unknown_arguments_are_errors(arguments):
    status, printed, errors = run(*arguments)
    assert status == 2 and not printed and arguments[-1].split(':=')[-1] in errors
