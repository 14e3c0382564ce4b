"""Top view of the floor in front of the camera with its marks (thesis Fig. 5.1). A click on a mark sets the truth."""
import math
from typing import Any, NamedTuple, Optional, Tuple

from ros_3d_bb.sessions.plausibility import position_text
from ros_3d_bb_annotator.lengths import length_text
from ros_3d_bb_annotator.qt import Qt, QtCore, QtGui, QtWidgets, Signal

GROUND, LINES, CAMERA, TEXT = (QtGui.QColor(*color) for color in (
    (250, 250, 248), (222, 222, 218), (120, 124, 130), (70, 70, 70)))
SIGHT, MARK, POINTED = QtGui.QColor(60, 120, 200, 22), QtGui.QColor(150, 150, 150), QtGui.QColor(0, 114, 178)
TRUTH, ESTIMATE = QtGui.QColor(0, 90, 170), QtGui.QColor(213, 94, 0)
MARGIN_PX, REACH_PX = 22, 16
MARK_PX, NAME_PX = 5, 11  # radius of a mark, height of its name
STEPS_M = (0.25, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0)


class FloorScene(NamedTuple):
    """Marks on the floor, positions (x, z) in metres or None, and tangents of the limits of the field of view."""

    marks: Tuple[Any, ...]
    truth_m: Optional[Tuple[float, float]]
    estimate_m: Optional[Tuple[float, float]]
    sight: Tuple[float, float]


class GridView(QtWidgets.QWidget):
    """Top view of the floor. `mark_chosen` is emitted with a Mark that is clicked."""

    mark_chosen = Signal(object)

    def __init__(self, parent=None):
        super(GridView, self).__init__(parent)
        self._scene, self._pointed = FloorScene((), None, None, (0.0, 0.0)), None
        self.setMouseTracking(True)
        self.setMinimumSize(160, 160)
        self.setAccessibleName('floor from above')

    def sizeHint(self):  # noqa: N802 (Qt's name)
        return QtCore.QSize(300, 260)

    def show_scene(self, scene):
        if scene.marks != self._scene.marks:
            self._pointed = None
        self._scene = scene
        self.update()

    def place_of(self, x_m, z_m):
        """Position (QPointF) of a point of the floor in this widget."""
        left_m, right_m, far_m = self._extent()
        scale = min((self.width() - 2 * MARGIN_PX) / (right_m - left_m), (self.height() - 2 * MARGIN_PX) / far_m)
        return QtCore.QPointF(self.width() / 2 + (x_m - (left_m + right_m) / 2) * scale,
                              self.height() - MARGIN_PX - z_m * scale)

    def _extent(self):
        """Left, right and far limit of the visible floor in metres, with a margin around its content."""
        points = [(mark.x_m, mark.z_m) for mark in self._scene.marks]
        points += [point for point in (self._scene.truth_m, self._scene.estimate_m) if point is not None]
        side_m = max([0.75] + [abs(x_m) + 0.25 for x_m, _z_m in points])
        return -side_m, side_m, max([1.5] + [z_m + 0.4 for _x_m, z_m in points])

    def paintEvent(self, _event):  # noqa: N802
        painter = QtGui.QPainter(self)
        painter.setRenderHint(QtGui.QPainter.Antialiasing)
        painter.fillRect(self.rect(), GROUND)
        self._paint_floor(painter)
        for mark in self._scene.marks:
            self._paint_mark(painter, mark)
        self._paint_error(painter)
        self._paint_legend(painter)
        if not self._scene.marks:
            painter.setPen(TEXT)
            painter.drawText(self.rect().adjusted(70, 6, -12, -6), Qt.AlignLeft | Qt.AlignTop | Qt.TextWordWrap,
                             'No floor marks yet: Edit, Floor marks (Ctrl+G).')

    def _paint_floor(self, painter):
        left_m, right_m, far_m = self._extent()
        font = painter.font()
        font.setPixelSize(NAME_PX)
        painter.setFont(font)
        far_m *= 1.5  # lines extend beyond the farthest mark
        step_m = next((step for step in STEPS_M if max(right_m - left_m, far_m) / step <= 9), STEPS_M[-1])
        painter.setPen(LINES)
        for number in range(math.ceil(4 * left_m / step_m), math.floor(4 * right_m / step_m) + 1):
            painter.drawLine(self.place_of(number * step_m, 0), self.place_of(number * step_m, far_m))
        depths_m = [number * step_m for number in range(int(far_m / step_m) + 1)]
        for z_m in depths_m:
            painter.drawLine(self.place_of(4 * left_m, z_m), self.place_of(4 * right_m, z_m))
        painter.setPen(TEXT)
        for z_m in depths_m[1:]:
            painter.drawText(QtCore.QPointF(4, self.place_of(0, z_m).y() - 2), length_text(z_m))
        camera = self.place_of(0, 0)
        sides = [self.place_of(tangent * 10 * far_m, 10 * far_m) for tangent in self._scene.sight]
        painter.setPen(Qt.NoPen)
        painter.setBrush(SIGHT)
        painter.drawPolygon(QtGui.QPolygonF([camera] + sides))
        painter.setBrush(CAMERA)
        painter.drawRoundedRect(QtCore.QRectF(camera.x() - 20, camera.y() - 4, 40, 11), 5, 5)

    def _paint_mark(self, painter, mark):
        place, pointed = self.place_of(mark.x_m, mark.z_m), mark == self._pointed
        radius = MARK_PX + 3 * pointed
        painter.setPen(QtGui.QPen(POINTED, 3) if pointed else QtGui.QPen(MARK.darker(130), 1))
        painter.setBrush(MARK)
        painter.drawEllipse(place, radius, radius)
        painter.setPen(TEXT)
        painter.drawText(QtCore.QRectF(place.x() - 60, place.y() + MARK_PX, 120, NAME_PX + 3), Qt.AlignHCenter,
                         mark.name)

    def _paint_error(self, painter):
        """The truth as a blue cross, the estimate as an orange circle, a line between them."""
        truth, estimate = (None if point is None else self.place_of(*point)
                           for point in (self._scene.truth_m, self._scene.estimate_m))
        painter.setBrush(Qt.NoBrush)
        if truth is not None and estimate is not None:
            painter.setPen(QtGui.QPen(ESTIMATE, 1.5, Qt.DashLine))
            painter.drawLine(truth, estimate)
        if truth is not None:
            painter.setPen(QtGui.QPen(TRUTH, 3))
            painter.drawLine(truth - QtCore.QPointF(7, 7), truth + QtCore.QPointF(7, 7))
            painter.drawLine(truth - QtCore.QPointF(7, -7), truth + QtCore.QPointF(7, -7))
        if estimate is not None:
            painter.setPen(QtGui.QPen(ESTIMATE, 2.5))
            painter.drawEllipse(estimate, 6, 6)

    def _paint_legend(self, painter):
        for row, (color, text) in enumerate(((TRUTH, '✕ true'), (ESTIMATE, '○ estimate'))):
            painter.setPen(color)
            painter.drawText(QtCore.QPointF(self.width() - 80, self.height() - 24 + 16 * row), text)

    def mouseMoveEvent(self, event):  # noqa: N802
        self._point_at(self._mark_at(event.localPos()))

    def leaveEvent(self, _event):  # noqa: N802
        self._point_at(None)

    def mousePressEvent(self, event):  # noqa: N802
        mark = self._mark_at(event.localPos())
        if event.button() == Qt.LeftButton and mark is not None:
            self.mark_chosen.emit(mark)

    def _point_at(self, mark):
        self._pointed = mark
        self.setToolTip('' if mark is None else '%s: %s' % (mark.name, position_text((mark.x_m, mark.z_m))))
        self.update()

    def _mark_at(self, position):
        """Mark nearest to a position in this widget, or None if there is none within REACH_PX."""
        def distance_px(mark):
            return (self.place_of(mark.x_m, mark.z_m) - position).manhattanLength()
        return min((mark for mark in self._scene.marks if distance_px(mark) <= REACH_PX), key=distance_px, default=None)
