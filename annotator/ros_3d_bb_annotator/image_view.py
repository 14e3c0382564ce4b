"""View of the images of a measurement side by side, with boxes, samples and a cursor."""
from typing import Any, NamedTuple

from ros_3d_bb_annotator import marking
from ros_3d_bb_annotator.qt import Qt, QtCore, QtGui, QtWidgets, Signal

BACKGROUND = QtGui.QColor(38, 40, 44)
MIN_ZOOM, MAX_ZOOM, WHEEL_STEP = 1.0, 40.0, 1.2
CLICK_PX = 4  # maximum movement of a click on the screen
MIN_BOX_PX = 4  # smaller boxes are ignored
GAP_PX = 6


class Panel(NamedTuple):
    """One image: its name, and the QImage, or None and the reason in `message`."""

    name: str
    image: Any = None
    message: str = ''


class ImageView(QtWidgets.QWidget):
    """View of two images of one size, which show the same part.

    Wheel: zoom; drag: pan; click: select a box; Shift and drag: draw a box. Image coordinates are continuous: pixel
    (u, v) covers u..u+1 and v..v+1. `cursor` is a pixel (u, v) or None. Signals: `pointed` when the cursor moves;
    `box_chosen` with the index of a box; `box_drawn` with (x1, y1, x2, y2) in pixels.
    """

    pointed = Signal()
    box_chosen = Signal(int)
    box_drawn = Signal(object)

    def __init__(self, parent=None):
        super(ImageView, self).__init__(parent)
        self.panels, self._scene = (Panel('colour'), Panel('depth')), marking.Scene((), None, ())
        self._size, self._zoom, self._center = (640, 480), MIN_ZOOM, (0.5, 0.5)  # centre as shares of the size
        self.cursor, self._panel = None, 0  # panel of the cursor
        self._cancel()
        self.setMouseTracking(True)
        self.setFocusPolicy(Qt.ClickFocus)
        self.setMinimumSize(480, 180)
        self.setAccessibleName('colour and depth image')

    def sizeHint(self):  # noqa: N802 (Qt's name)
        return QtCore.QSize(1280, 480)

    def show_images(self, panels, scene):
        """Show Panels with an overlay (`marking.Scene`). Zoom and position are kept."""
        self.panels, self._scene = panels, scene
        for image in [panel.image for panel in panels if panel.image is not None]:
            self._size = image.width(), image.height()
        if self.cursor is not None and not self._is_inside(self.cursor):
            self.cursor = None
        self._cancel()

    def fit(self):
        self._zoom = MIN_ZOOM
        self._move_center(0.5, 0.5)

    def zoom_by(self, factor, anchor):
        """Zoom around the point `anchor` (x, y) of the image."""
        zoom = min(max(self._zoom * factor, MIN_ZOOM), MAX_ZOOM)
        shares, ratio = [value / size for value, size in zip(anchor, self._size)], self._zoom / zoom
        self._zoom = zoom
        self._move_center(*(share + (center - share) * ratio for share, center in zip(shares, self._center)))

    def transform(self, panel):
        """QTransform from image coordinates to this widget, for the index of a panel."""
        rect, (width, height), (x, y) = self._rect_of(panel), self._size, self._center
        scale = min(rect.width() / width, rect.height() / height) * self._zoom
        return QtGui.QTransform(scale, 0, 0, scale, rect.x() + rect.width() / 2 - x * width * scale,
                                rect.height() / 2 - y * height * scale)

    def paintEvent(self, _event):  # noqa: N802
        painter = QtGui.QPainter(self)
        for number, panel in enumerate(self.panels):
            rect, transform = self._rect_of(number), self.transform(number)
            painter.setClipRect(rect)
            painter.fillRect(rect, BACKGROUND)
            if panel.image is None:
                marking.paint_message(painter, rect, panel.message)
            else:
                painter.setTransform(transform)
                painter.setRenderHint(QtGui.QPainter.SmoothPixmapTransform, transform.m11() < 1)
                painter.drawImage(QtCore.QPointF(0, 0), panel.image)
                painter.resetTransform()
                marking.paint_scene(painter, transform, self._scene)
                marking.paint_cursor(painter, transform, self.cursor, self._band())
            marking.paint_caption(painter, rect, panel.name)

    def wheelEvent(self, event):  # noqa: N802
        position = event.position() if hasattr(event, 'position') else event.posF()
        self._panel = self._panel_at(position)
        self.zoom_by(WHEEL_STEP ** (event.angleDelta().y() / 120.0), self._to_image(position))

    def mousePressEvent(self, event):  # noqa: N802
        self._panel = self._panel_at(event.localPos())
        if event.button() != Qt.LeftButton or self.panels[self._panel].image is None:
            return
        self._pressed_at = self._panned_from = event.localPos()
        if event.modifiers() & Qt.ShiftModifier:
            self._panned_from = None
            self._point_near(event)
            self._corner = self.cursor

    def mouseMoveEvent(self, event):  # noqa: N802
        if self._pressed_at is None:
            self._panel = self._panel_at(event.localPos())
            if self.panels[self._panel].image is not None:
                self._point_at(*self._pixel(event))
        elif self._corner is not None:
            self._point_near(event)
        else:
            (old_x, old_y), (x, y) = map(self._to_image, (self._panned_from, event.localPos()))
            self._panned_from = event.localPos()
            self._move_center(self._center[0] + (old_x - x) / self._size[0],
                              self._center[1] + (old_y - y) / self._size[1])

    def mouseReleaseEvent(self, event):  # noqa: N802
        if event.button() != Qt.LeftButton or self._pressed_at is None:
            return
        moved_px = (event.localPos() - self._pressed_at).manhattanLength()
        is_click = self._corner is None and moved_px <= CLICK_PX
        if self._corner is not None:
            self._point_near(event)
        box_px = self._band()
        self._cancel()
        if is_click:
            number = self._scene.box_at(*self._to_image(event.localPos()))
            if number is not None:
                self.box_chosen.emit(number)
        elif box_px is not None:
            x1, y1, x2, y2 = box_px
            if min(x2 - x1, y2 - y1) >= MIN_BOX_PX:
                self.box_drawn.emit(box_px)

    def leaveEvent(self, _event):  # noqa: N802
        if self._corner is None:
            self._point_at(-1, -1)

    def _cancel(self):
        """End the action of the mouse: `_corner`, the first corner of a box that is being drawn, is a pixel or None."""
        self._pressed_at = self._panned_from = self._corner = None
        self.update()

    def _move_center(self, *center):
        margin = 0.5 / self._zoom
        self._center = tuple(min(max(share, margin), 1 - margin) for share in center)
        self.update()

    def _band(self):
        """Box that is being drawn, (x1, y1, x2, y2), including the pixels of both corners, or None."""
        if self._corner is None or self.cursor is None:
            return None
        (u1, v1), (u2, v2) = self._corner, self.cursor
        return min(u1, u2), min(v1, v2), max(u1, u2) + 1, max(v1, v2) + 1

    def _rect_of(self, panel):
        width = (self.width() - GAP_PX) // 2
        return QtCore.QRect(panel * (width + GAP_PX), 0, width, self.height())

    def _panel_at(self, position):
        return int(position.x() >= self._rect_of(1).x())

    def _to_image(self, position):
        """Convert a position (QPointF) in the panel of the cursor to image coordinates (x, y)."""
        inverse, _ok = self.transform(self._panel).inverted()
        point = inverse.map(position)
        return point.x(), point.y()

    def _pixel(self, event):
        return tuple(int(value // 1) for value in self._to_image(event.localPos()))

    def _is_inside(self, pixel):
        return all(0 <= value < size for value, size in zip(pixel, self._size))

    def _point_at(self, u, v):
        self.cursor = (u, v) if self._is_inside((u, v)) else None
        self.pointed.emit()
        self.update()

    def _point_near(self, event):
        self._point_at(*(min(max(value, 0), size - 1) for value, size in zip(self._pixel(event), self._size)))
