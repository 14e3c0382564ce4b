"""Painting of overlays: boxes, samples, cursor, caption. Boxes and pixels are in image coordinates."""
from typing import Any, NamedTuple, Optional, Tuple

import numpy as np

from ros_3d_bb.visualization.image_overlay import INVALID_COLOR, VALID_COLOR

from ros_3d_bb_annotator.qt import Qt, QtCore, QtGui

CHOSEN, OTHER, DRAWN = QtGui.QColor(255, 159, 28), QtGui.QColor(120, 200, 255), QtGui.QColor(255, 255, 255)
CAPTION = QtGui.QColor(0, 0, 0, 150)
SAMPLE_PX, SAMPLES_APART_PX = 3, 9  # on the screen


class MarkedBox(NamedTuple):
    """Box (x1, y1, x2, y2) of the detection `number` with its label. `by_hand`: a user drew it."""

    number: int
    rect_px: Tuple[int, int, int, int]
    label: str
    by_hand: bool


class Scene(NamedTuple):
    """Overlay of an image: boxes, index of the person's box or None, and visible box3d_estimator.Samples."""

    boxes: Tuple[MarkedBox, ...]
    person: Optional[int]
    samples: Tuple[Any, ...]

    def box_at(self, x, y):
        """Index of the smallest box that contains a point of the image, or None."""
        inside = [((x2 - x1) * (y2 - y1), number) for number, (x1, y1, x2, y2), _label, _by_hand in self.boxes
                  if x1 <= x < x2 and y1 <= y < y2]
        return min(inside)[1] if inside else None


def paint_scene(painter, transform, scene):
    for samples in scene.samples:
        _paint_samples(painter, transform, samples)
    boxes = sorted(scene.boxes, key=lambda box: box.number == scene.person)  # the person's on top
    for box in boxes:
        color, width = (CHOSEN, 3) if box.number == scene.person else (OTHER, 1.5)
        _paint_box(painter, transform, box.rect_px, color, (width, Qt.DashLine if box.by_hand else Qt.SolidLine))
    for box in boxes:
        _paint_label(painter, transform.map(QtCore.QPointF(*box.rect_px[:2])), box.label,
                     CHOSEN if box.number == scene.person else OTHER)


def paint_cursor(painter, transform, cursor, band):
    """Paint the crosshair at a pixel (u, v) or None, and the box that is being drawn, or None."""
    if band is not None:
        _paint_box(painter, transform, band, DRAWN, (2, Qt.SolidLine))
    if cursor is None:
        return
    point = transform.map(QtCore.QPointF(cursor[0] + 0.5, cursor[1] + 0.5))
    arm = 12 if band is None else 3000
    for color, width in ((QtGui.QColor(0, 0, 0, 160), 3), (DRAWN if arm > 12 else Qt.white, 1)):
        painter.setPen(QtGui.QPen(color, width))
        painter.drawLine(point - QtCore.QPointF(arm, 0), point + QtCore.QPointF(arm, 0))
        painter.drawLine(point - QtCore.QPointF(0, arm), point + QtCore.QPointF(0, arm))


def paint_caption(painter, rect, name):
    """Paint the name of the view at the bottom, because labels of boxes are at the top."""
    _paint_label(painter, QtCore.QPointF(rect.left(), rect.bottom() + 1), name, CAPTION)


def paint_message(painter, rect, message):
    painter.setPen(Qt.white)
    option = QtGui.QTextOption(Qt.AlignCenter)
    option.setWrapMode(QtGui.QTextOption.WrapAtWordBoundaryOrAnywhere)  # paths have no spaces
    painter.drawText(QtCore.QRectF(rect.adjusted(24, 24, -24, -24)), message, option)


def _paint_samples(painter, transform, samples):
    """Paint the samples of a box, or every n-th if they are too close to each other on the screen."""
    shown = _thinned(samples.rows, transform.m11()), _thinned(samples.columns, transform.m11())
    pixels, valid = samples.pixels[shown], samples.valid[shown]
    for kind, color in ((valid, VALID_COLOR), (~valid, INVALID_COLOR)):
        painter.setPen(QtGui.QPen(QtGui.QColor(*color), SAMPLE_PX, Qt.SolidLine, Qt.RoundCap))
        painter.drawPoints(transform.map(QtGui.QPolygonF([
            QtCore.QPointF(u + 0.5, v + 0.5) for u, v in pixels[kind].tolist()])))


def _thinned(ticks, scale):
    """Slice of the ticks (n,) of a grid that are at least `SAMPLES_APART_PX` apart on the screen."""
    if ticks.size < 2:
        return slice(None)
    every = int(np.ceil(SAMPLES_APART_PX / ((ticks[1] - ticks[0]) * scale)))
    return slice(every // 2, None, every)


def _paint_box(painter, transform, box_px, color, stroke):
    x1, y1, x2, y2 = box_px
    painter.setBrush(Qt.NoBrush)
    outline = QtGui.QPen(QtGui.QColor(0, 0, 0, 130), stroke[0] + 2)  # visible on any background
    for pen in (outline, QtGui.QPen(color, *stroke)):
        painter.setPen(pen)
        painter.drawRect(transform.mapRect(QtCore.QRectF(x1, y1, x2 - x1, y2 - y1)))


def _paint_label(painter, corner, text, color):
    if not text:
        return
    metrics = painter.fontMetrics()
    width, height = metrics.boundingRect(text).width() + 10, metrics.height() + 2
    rect = QtCore.QRectF(corner.x(), max(corner.y() - height, 0), width, height)
    painter.fillRect(rect, color)
    painter.setPen(Qt.white if color is CAPTION else Qt.black)
    painter.drawText(rect, Qt.AlignCenter, text)
