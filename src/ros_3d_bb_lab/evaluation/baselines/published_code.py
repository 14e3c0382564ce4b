"""The published code of the thesis, in a checkout of github.com/Jyrijoul/ros_3d_bb. Nothing of it is in this package.

Its main.py, tracker.py and predictor.py are imported as they are, without its nodes. Modules that are not installed,
such as pyrealsense2, are replaced by empty ones. Logging, timing and drawing are switched off, and its optimized
version is used.
"""
import contextlib
import importlib
import importlib.util
import os
import sys
import types
from unittest import mock

import numpy as np

from ros_3d_bb.camera.camera_model import transform_points

MODULES = 'predictor', 'main', 'tracker'
OFF = 'VERBOSE', 'DEBUG', 'TIMING', 'TIMING_DETAILED', 'MODIFY_COLOR_IMAGE', 'MODIFY_COLOR_IMG', 'VISUALIZATION'
OPTIMIZED = 'USE_OPTIMIZED'
# As its tracker_node: images that a track survives, and weight of the newest velocity; a prediction of 2 s at 30 Hz.
LONGEST_MISSED, SENSITIVITY, AHEAD_IMAGES = 30, 0.2, 60


class _Empty(types.ModuleType):
    """Stands for a module that is not installed; each of its attributes is an exception class."""

    __path__ = []

    def __getattr__(self, name):
        if name.startswith('__'):
            raise AttributeError(name)
        return type(name, (Exception,), {})


class _EmptyModules(object):
    """Finds, after the other finders of Python, an `_Empty` for each module."""

    def find_spec(self, name, _path=None, _target=None):
        return importlib.util.spec_from_loader(name, self)

    def create_module(self, spec):
        return _Empty(spec.name)

    def exec_module(self, _module):
        pass


@contextlib.contextmanager
def _importing_from(folder):
    """Within the block, modules are imported from a folder first, and an `_Empty` stands for each missing one, and for
    this package. The other modules are afterwards as before."""
    own = {name: sys.modules.pop(name, None) for name in MODULES + ('ros_3d_bb', 'ros_3d_bb.msg')}
    sys.modules.update({name: _Empty(name) for name in ('ros_3d_bb', 'ros_3d_bb.msg')})
    with mock.patch.object(sys, 'path', [folder] + sys.path), \
            mock.patch.object(sys, 'meta_path', sys.meta_path + [_EmptyModules()]):
        try:
            yield
        finally:
            for name in [name for name, module in sys.modules.items() if isinstance(module, _Empty)] + list(own):
                sys.modules.pop(name, None)
            sys.modules.update({name: module for name, module in own.items() if module is not None})


def load_published(folder):
    """The modules {name: module} of a checkout. Raises ValueError if it lacks one or one cannot be imported."""
    folders = [each for each in (folder, os.path.join(folder, 'scripts'))
               if all(os.path.isfile(os.path.join(each, name + '.py')) for name in MODULES)]
    if not folders:
        raise ValueError('%s has no %s, also not in scripts/; a checkout of github.com/Jyrijoul/ros_3d_bb expected'
                         % (folder, ', '.join(name + '.py' for name in MODULES)))
    with _importing_from(folders[0]):
        modules = {}
        for name in MODULES:
            try:
                modules[name] = importlib.import_module(name)
            except Exception as error:
                raise ValueError('%s.py in %s cannot be imported: %s' % (name, folders[0], error))
            sys.modules['ros_3d_bb'].Predictor = modules['predictor'].Predictor  # some versions import it from there
    for module in modules.values():
        vars(module).update(dict.fromkeys(OFF, False), **{OPTIMIZED: True})
    return modules


class PublishedCode(object):
    """Its algorithms for the images of one camera; `modules` are those of `load_published`."""

    def __init__(self, modules, camera, scale_m, fixed_from_camera):
        self._box, self._fixed_from_camera = modules['tracker'].BoundingBox, fixed_from_camera
        self._node = modules['main'].Ros_3d_bb.__new__(modules['main'].Ros_3d_bb)  # without its subscribers
        vars(self._node).update({name.lower(): False for name in OFF}, use_optimized=True, depth_scale=scale_m)
        self._node.intrinsics = types.SimpleNamespace(ppx=camera.cx, ppy=camera.cy, fx=camera.fx, fy=camera.fy)
        self._tracker = modules['tracker'].Tracker(LONGEST_MISSED)
        self._predictor = modules['predictor'].Predictor(self._tracker, SENSITIVITY)

    def estimate(self, depth, rects_px):
        self._node.depth_image = depth.values
        self._node.bounding_box_callback(types.SimpleNamespace(data=[edge for rect_px in rects_px for edge in rect_px]))
        return [box for box in self._node.bounding_boxes_3d.values() if box[2] != 0]

    def track(self, _stamp_ns, boxes):
        self._tracker.update([self._box(*transform_points(self._fixed_from_camera, np.array(box[:3])), *box[3:])
                              for box in boxes])
        self._predictor.update()
        self._predictor.predict(AHEAD_IMAGES)
        return {track_id: prediction[:2] for track_id, prediction in self._predictor.predictions.items()}
