"""View of an image with boxes, samples and a cursor. Several views are linked by a SharedView."""
from ros_3d_bb_annotator import marking
from ros_3d_bb_annotator.qt import Qt, QtCore, QtGui, QtWidgets, Signal

BACKGROUND = QtGui.QColor(38, 40, 44)
WHEEL_STEP = 1.2
CURSOR_STEP_PX, PAN_STEP_PX = 10, 40
CLICK_PX, GRAB_PX = 4, 6  # maximum movement of a click, and distance from an edge, on the screen
ALL_EDGES, LOWER_RIGHT = (0, 1, 2, 3), (2, 3)
ARROWS = {Qt.Key_Left: (-1, 0), Qt.Key_Right: (1, 0), Qt.Key_Up: (0, -1), Qt.Key_Down: (0, 1)}


class ImageView(QtWidgets.QWidget):
    """View of one image. If `image` is None, `message` is the reason. `box_chosen` is emitted with the index of a box.

    Wheel: zoom; drag: pan; click: select a box; Shift and drag, or drag while drawing: draw a box; drag an edge of the
    selected box: resize it; Ctrl and drag: move it. Arrow keys move the cursor by 10 pixels (Ctrl: 1), Shift and arrow
    keys pan, Space sets the corners of a box, Escape cancels it. While a box is edited, arrow keys move it, or with
    Shift its lower right corner.
    """

    box_chosen = Signal(int)

    def __init__(self, name, shared, parent=None):
        super(ImageView, self).__init__(parent)
        self._name, self._shared = name, shared
        self.image, self.message, self._scene, self._legend = None, '', marking.NOTHING, None
        self._pressed_at, self._panned_from, self._grabbed = None, None, ()
        self.setMouseTracking(True)
        self.setFocusPolicy(Qt.StrongFocus)
        self.setMinimumSize(240, 180)
        self.setAccessibleName('%s image' % name)
        shared.changed.connect(self.update)

    def sizeHint(self):  # noqa: N802 (Qt's name)
        return QtCore.QSize(640, 480)

    def show_image(self, image, scene, message=''):
        """Show a QImage with overlay (`marking.Scene`), or a message."""
        self.image, self.message, self._scene = image, message, scene
        self.update()

    def show_legend(self, legend):
        """Show a colour scale (QImage, text above, text below), or none."""
        self._legend = legend
        self.update()

    def show_scene(self, scene):
        self._scene = scene
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
        marking.paint_frame(painter, self.rect(), self._name, self._legend, self.hasFocus())

    def wheelEvent(self, event):  # noqa: N802
        factor = WHEEL_STEP ** (event.angleDelta().y() / 120.0)
        position = event.position() if hasattr(event, 'position') else event.posF()
        self._shared.zoom_by(factor, self.to_image(position))

    def mousePressEvent(self, event):  # noqa: N802
        if event.button() != Qt.LeftButton or self.image is None:
            return
        self._pressed_at = self._panned_from = event.localPos()
        self._grabbed = () if self._shared.drawing else self._edges_at(event)
        if self._grabbed:
            self._shared.start_editing(self._scene.person_box().rect_px)
        elif self._shared.drawing or event.modifiers() & Qt.ShiftModifier:
            self._panned_from = None
            self._point_near(event)
            self._shared.corner = None
            self._shared.set_corner()

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
            self._shared.finish_editing()
        elif was_grabbed:
            self._shared.cancel()
        elif self._shared.corner is not None:
            self._point_near(event)
            self._shared.set_corner()
        elif clicked:
            number = self._scene.box_at(*self.to_image(event.localPos()))
            if number is not None:
                self.box_chosen.emit(number)

    def leaveEvent(self, _event):  # noqa: N802
        if self._shared.corner is None:
            self._shared.point_at(-1, -1)

    def keyPressEvent(self, event):  # noqa: N802
        key, modifiers = event.key(), event.modifiers()
        if self.image is None:
            event.ignore()
        elif self._shared.edited is not None:
            self._edit_by_key(key, modifiers)
        elif key in ARROWS and modifiers & Qt.ShiftModifier:
            self._shared.pan_by(*(PAN_STEP_PX / self._shared.zoom * way for way in ARROWS[key]))
        elif key in ARROWS:
            step = 1 if modifiers & Qt.ControlModifier else CURSOR_STEP_PX
            self._shared.step(*(step * way for way in ARROWS[key]))
        elif key == Qt.Key_Space or (key in (Qt.Key_Return, Qt.Key_Enter) and self._shared.corner is not None):
            self._shared.set_corner()
        elif key == Qt.Key_Escape and (self._shared.drawing or self._shared.corner is not None):
            self._shared.cancel()
        else:
            event.ignore()

    def _edit_by_key(self, key, modifiers):
        if key in ARROWS:
            step = 1 if modifiers & Qt.ControlModifier else CURSOR_STEP_PX
            self._shared.nudge(LOWER_RIGHT if modifiers & Qt.ShiftModifier else ALL_EDGES,
                               *(step * way for way in ARROWS[key]))
        elif key in (Qt.Key_Return, Qt.Key_Enter, Qt.Key_Space):
            self._shared.finish_editing()
        elif key == Qt.Key_Escape:
            self._shared.cancel()

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
