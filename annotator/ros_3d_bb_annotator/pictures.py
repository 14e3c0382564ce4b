"""Images of measurements as QImages."""
from typing import Any, NamedTuple

import numpy as np

from ros_3d_bb.visualization.image_overlay import DEPTH_RANGE_M, colorize_depth, depth_to_grey
from ros_3d_bb_annotator.qt import QtGui


class Pictures(NamedTuple):
    """QImages of a measurement or None, with the problems, and the DepthImage or None."""

    color_image: Any
    color_problem: str
    depth_image: Any
    depth_problem: str
    depth: Any


def read_pictures(document, number):
    """Read the Pictures of a measurement."""
    color, color_problem = _read_or_error(document.color, number)
    depth, depth_problem = _read_or_error(document.depth, number)
    shown = None if depth is None else colorize_depth(depth_to_grey(depth, DEPTH_RANGE_M))
    return Pictures(_image_of(color), color_problem, _image_of(shown), depth_problem, depth)


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
