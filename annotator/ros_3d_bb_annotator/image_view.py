"""View of an image with boxes, samples and a cursor. Several views are linked by a SharedView."""
from ros_3d_bb_annotator import marking
from ros_3d_bb_annotator.qt import Qt, QtCore, QtGui, QtWidgets, Signal

BACKGROUND = QtGui.QColor(38, 40, 44)
WHEEL_STEP = 1.2
CLICK_PX, GRAB_PX = 4, 6  # maximum movement of a click, and distance from an edge, on the screen
ALL_EDGES = (0, 1, 2, 3)


class ImageView(QtWidgets.QWidget):
    """View of one image. If `image` is None, `message` is the reason. `box_chosen` is emitted with the index of a box.

    Wheel: zoom; drag: pan; click: select a box; Shift and drag: draw a box; drag an edge of the selected box: resize
    it; Ctrl and drag: move it.
    """

    box_chosen = Signal(int)

    def __init__(self, name, shared, parent=None):
        super(ImageView, self).__init__(parent)
        self._name, self._shared = name, shared
        self.image, self.message, self._scene = None, '', marking.Scene((), None, ())
        self._pressed_at, self._panned_from, self._grabbed = None, None, ()
        self.setMouseTracking(True)
        self.setFocusPolicy(Qt.ClickFocus)
        self.setMinimumSize(240, 180)
        self.setAccessibleName('%s image' % name)
        shared.changed.connect(self.update)

    def sizeHint(self):  # noqa: N802 (Qt's name)
        return QtCore.QSize(640, 480)

    def show_image(self, image, scene, message=''):
        """Show a QImage with overlay (`marking.Scene`), or a message."""
        self.image, self.message, self._scene = image, message, scene
        self.update()

    def to_image(self, position):
        """Convert a position (QPointF) in this widget to image coordinates (x, y). Inverse of `transform`."""
        inverse, _ok = self.transform().inverted()
        point = inverse.map(position)
        return point.x(), point.y()

    def transform(self):
        """QTransform from image coordinates to this widget."""
        (width, height), (x, y) = self._shared.size, self._shared.center
        scale = min(self.width() / width, self.height() / height) * self._shared.zoom
        return QtGui.QTransform(scale, 0, 0, scale, self.width() / 2 - x * width * scale,
                                self.height() / 2 - y * height * scale)

    def paintEvent(self, _event):  # noqa: N802
        painter = QtGui.QPainter(self)
        painter.fillRect(self.rect(), BACKGROUND)
        if self.image is None:
            marking.paint_message(painter, self.rect(), self.message)
        else:
            transform = self.transform()
            painter.setTransform(transform)
            painter.setRenderHint(QtGui.QPainter.SmoothPixmapTransform, transform.m11() < 1)
            painter.drawImage(QtCore.QPointF(0, 0), self.image)
            painter.resetTransform()
            marking.paint_scene(painter, transform, self._scene)
            marking.paint_cursor(painter, transform, self._shared)
        marking.paint_caption(painter, self.rect(), self._name)

    def wheelEvent(self, event):  # noqa: N802
        factor = WHEEL_STEP ** (event.angleDelta().y() / 120.0)
        position = event.position() if hasattr(event, 'position') else event.posF()
        self._shared.zoom_by(factor, self.to_image(position))

    def mousePressEvent(self, event):  # noqa: N802
        if event.button() != Qt.LeftButton or self.image is None:
            return
        self._pressed_at = self._panned_from = event.localPos()
        self._grabbed = self._edges_at(event)
        if self._grabbed:
            self._shared.start_editing(self._scene.person_box().rect_px)
        elif event.modifiers() & Qt.ShiftModifier:
            self._panned_from = None
            self._point_near(event)
            self._shared.start_drawing()

    def mouseMoveEvent(self, event):  # noqa: N802
        if self._pressed_at is not None and self._grabbed:
            (old_x, old_y), (x, y) = self.to_image(self._pressed_at), self.to_image(event.localPos())
            self._shared.start_editing(self._scene.person_box().rect_px)
            self._shared.nudge(self._grabbed, int(round(x - old_x)), int(round(y - old_y)))
        elif self._pressed_at is not None and self._panned_from is not None:
            (old_x, old_y), (x, y) = self.to_image(self._panned_from), self.to_image(event.localPos())
            self._panned_from = event.localPos()
            self._shared.pan_by(old_x - x, old_y - y)
        elif self._shared.corner is not None:
            self._point_near(event)
        elif self.image is not None:
            self._shared.point_at(*self._pixel(event))
            self.setCursor(Qt.SizeAllCursor if self._edges_at(event) else Qt.ArrowCursor)

    def mouseReleaseEvent(self, event):  # noqa: N802
        if event.button() != Qt.LeftButton or self._pressed_at is None:
            return
        moved = (event.localPos() - self._pressed_at).manhattanLength()
        clicked = self._panned_from is not None and moved <= CLICK_PX
        was_grabbed, self._grabbed = bool(self._grabbed), ()
        self._pressed_at = self._panned_from = None
        if was_grabbed and not clicked:
            self._shared.finish()
        elif was_grabbed:
            self._shared.cancel()
        elif self._shared.corner is not None:
            self._point_near(event)
            self._shared.finish()
        elif clicked:
            number = self._scene.box_at(*self.to_image(event.localPos()))
            if number is not None:
                self.box_chosen.emit(number)

    def leaveEvent(self, _event):  # noqa: N802
        if self._shared.corner is None:
            self._shared.point_at(-1, -1)

    def _edges_at(self, event):
        """Edges (0 to 3) of the selected box at the mouse; with Ctrl all of them inside the box; () elsewhere."""
        box = self._scene.person_box()
        if box is None or event.modifiers() & Qt.ShiftModifier:
            return ()
        place, rect = event.localPos(), self.transform().mapRect(QtCore.QRectF(
            QtCore.QPointF(*box.rect_px[:2]), QtCore.QPointF(*box.rect_px[2:])))
        if event.modifiers() & Qt.ControlModifier:
            return ALL_EDGES if rect.contains(place) else ()
        if not rect.adjusted(-GRAB_PX, -GRAB_PX, GRAB_PX, GRAB_PX).contains(place):
            return ()
        distances = (place.x() - rect.left(), place.y() - rect.top(), place.x() - rect.right(),
                     place.y() - rect.bottom())
        return tuple(edge for edge, distance in enumerate(distances) if abs(distance) <= GRAB_PX)

    def _pixel(self, event):
        return tuple(int(value // 1) for value in self.to_image(event.localPos()))

    def _point_near(self, event):
        """Move the cursor to the mouse position, clipped to the image."""
        self._shared.point_at(*(min(max(value, 0), size - 1)
                                for value, size in zip(self._pixel(event), self._shared.size)))
