"""Tests that need packages of requirements.txt, which a machine with only the dependencies of package.xml lacks."""
import importlib.util
import os
import re
import shutil

TEST = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))


def is_missing(module):
    try:
        return importlib.util.find_spec(module) is None
    except ImportError:  # of its package
        return True


def missing_requirements():
    names = set()
    for name in ('requirements.txt', 'requirements_no_deps.txt'):
        with open(os.path.join(TEST, name)) as stream:
            names.update(re.findall(r'^(?!pytest)([\w-]+)', stream.read(), re.MULTILINE))
    return set(filter(is_missing, (name.replace('-', '_') for name in names)))


def missing_for(item):
    """Modules and programs that a test needs and that are missing: those of `@pytest.mark.needs('module')`, and torch
    for the fixture `weights`.
    """
    names = [name for mark in item.iter_markers('needs') for name in mark.args]
    names += ['torch'] * ('weights' in getattr(item, 'fixturenames', ()))
    return set(name for name in names if is_missing(name) and shutil.which(name) is None)
