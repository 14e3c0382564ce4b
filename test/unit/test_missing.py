"""Tests are left out only where that is asked for, and only where what they import is missing."""
import importlib.util
import os
import types

import pytest

import conftest
from support.missing import TEST, imports_when_loaded, misses_something, missing_requirements


@pytest.fixture
def without_onnx(monkeypatch):
    """A machine without the package onnx."""
    find_spec = importlib.util.find_spec
    monkeypatch.setattr(importlib.util, 'find_spec', lambda name: None if name == 'onnx' else find_spec(name))


def config_that_leaves_out(asked_for):
    return types.SimpleNamespace(getoption=lambda _name: asked_for)


def test_what_is_not_installed_is_missing(without_onnx):
    assert 'onnx' in missing_requirements() and 'numpy' not in missing_requirements()


def test_nothing_is_left_out_unless_asked_for(without_onnx):
    assert conftest.left_out(config_that_leaves_out(False)) == set()
    assert 'onnx' in conftest.left_out(config_that_leaves_out(True))


@pytest.mark.parametrize('path, module', [('unit/test_onnx_cache.py', 'onnx'),
                                          ('nodes/test_realsense_node.py', 'pyrealsense2')])  # by a helper
def test_a_file_needs_what_it_and_its_helpers_import(path, module):
    assert module in imports_when_loaded(os.path.join(TEST, path))
    assert module not in imports_when_loaded(os.path.join(TEST, 'unit', 'test_camera_model.py'))


@pytest.mark.parametrize('names, misses', [(('numpy', 'json.decoder'), False), (('numpy', 'onnx'), True),
                                           (('numpy.nothing',), True), (('onnx.nothing',), True), ((), False)])
def test_a_single_test_says_what_it_needs(without_onnx, names, misses):
    item = types.SimpleNamespace(iter_markers=lambda _name: [types.SimpleNamespace(args=names)] * bool(names))
    assert misses_something(item) == misses
