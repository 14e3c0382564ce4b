"""Images of measurements as QImages, with a cache."""
import collections
from typing import Any, NamedTuple

import numpy as np

from ros_3d_bb.visualization.image_overlay import DEPTH_RANGE_M, colorize_depth, depth_to_grey
from ros_3d_bb_annotator.qt import QtGui

CACHE_SIZE = 7  # number of measurements: the current one and its neighbours


class Pictures(NamedTuple):
    """QImages of a measurement or None, with the problems, and the DepthImage or None."""

    color_image: Any
    color_problem: str
    depth_image: Any
    depth_problem: str
    depth: Any


class PictureCache(object):
    """Cache of the images of recently shown measurements. Another measurement may get the number of a deleted one."""

    def __init__(self, document):
        self._document, self._cache = document, collections.OrderedDict()
        self.clear = self._cache.clear

    def of(self, number):
        key = self._key(number)
        if key in self._cache:
            self._cache.move_to_end(key)
        else:
            self._cache[key] = self._read(number)
        while len(self._cache) > CACHE_SIZE:
            self._cache.popitem(last=False)
        return self._cache[key]

    def read_ahead(self, number):
        """Read the pictures of a measurement into the cache. Returns whether they were missing there."""
        if self._key(number) in self._cache:
            return False
        self.of(number)
        return True

    def _key(self, number):
        measurement = self._document.measurements[number]
        return measurement.color_path, measurement.depth_path, measurement.id

    def _read(self, number):
        color, color_problem = _read_or_error(self._document.color, number)
        if self._document.is_old_format:
            depth, (stretched, depth_problem) = None, _read_or_error(self._document.stretched_depth, number)
            shown = None if stretched is None else _grey_image(stretched)
        else:
            depth, depth_problem = _read_or_error(self._document.depth, number)
            shown = None if depth is None else colorize_depth(depth_to_grey(depth, DEPTH_RANGE_M))
        return Pictures(_image_of(color), color_problem, _image_of(shown), depth_problem, depth)


def _grey_image(values):
    """Convert an image (height, width), uint8 or uint16, to RGB, (height, width, 3), uint8."""
    grey = values if values.dtype == np.uint8 else (values // 256).astype(np.uint8)
    return np.repeat(grey[..., None], 3, axis=2)


def depth_scale():
    """QImage of the colour scale of depth, from far (top) to near (bottom)."""
    grey = np.linspace(1, 255, 255).astype(np.uint8)[:, None]
    return _image_of(colorize_depth(grey))


def _image_of(rgb):
    """Convert an image (height, width, 3), uint8, RGB, or None to a QImage or None."""
    if rgb is None:
        return None
    rgb = np.ascontiguousarray(rgb)
    height, width = rgb.shape[:2]
    return QtGui.QImage(rgb.data, width, height, 3 * width, QtGui.QImage.Format_RGB888).copy()


def _read_or_error(read, number):
    try:
        return read(number), ''
    except (ValueError, OSError) as error:
        return None, str(error)
