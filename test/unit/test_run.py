"""The arguments of ./run. Nothing is installed or built."""
import os
import subprocess
import sys

import pytest

RUN = os.path.join(os.path.dirname(os.path.abspath(__file__)), os.pardir, os.pardir, 'run')


def run(*arguments):
    """Exit status, standard output and standard error."""
    result = subprocess.run(['bash', RUN] + list(arguments), stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
                            stderr=subprocess.PIPE, universal_newlines=True)
    return result.returncode, result.stdout, result.stderr


@pytest.mark.parametrize('arguments', [(), ('help',), ('--help',), ('test', '--help'), ('demo', '--help')])
def test_help_starts_nothing(arguments):
    status, printed, errors = run(*arguments)
    assert status == 0 and printed.startswith('usage: ./run') and not errors


@pytest.mark.parametrize('arguments', [
    ('tset',), ('test', '--quick'), ('test', '--fast', 'x'), ('test', '--platform'), ('test', '--platform', 'kinetic'),
    ('test', '--platform', 'noetic', '--python'), ('test', '--platform', 'noetic', '--python', '/bin/false'),
    ('test', '--platform', 'bullseye', '--python', '/bin/false'),
    ('test', 'missing.py'), ('test', '-k'), ('build', 'x'), ('setup', 'x'), ('pictures', 'missing'), ('lint', '--all'),
    ('demo', '--fast'), ('demo', 'missing'), ('demo', 'rate:=fast'), ('demo', 'weights:=missing.pt')])
def test_unknown_arguments_are_errors(arguments):
    status, printed, errors = run(*arguments)
    assert status == 2 and not printed and arguments[-1].split(':=')[-1] in errors


@pytest.mark.slow
def test_unit_tests_need_no_workspace():
    """`./run test --fast` runs them without a build: they import neither messages nor a master."""
    environment = {name: value for name, value in os.environ.items() if name not in ('PYTHONPATH', 'CMAKE_PREFIX_PATH')}
    collected = subprocess.run([sys.executable, '-m', 'pytest', '-q', '--collect-only', '--leave-out', '-p',
                                'no:cacheprovider', os.path.dirname(os.path.abspath(__file__))], env=environment,
                               stdout=subprocess.PIPE, universal_newlines=True)
    assert collected.returncode == 0, collected.stdout[-2000:]


def test_no_two_test_files_have_the_same_name():
    """Otherwise pytest cannot run the unit tests and those of the workspace together, as `./run test -k` does."""
    folder = os.path.join(os.path.dirname(RUN), 'test')
    assert not set(os.listdir(os.path.join(folder, 'unit'))) & set(os.listdir(os.path.join(folder, 'workspace'))) - {
        '__pycache__', '__init__.py'}
