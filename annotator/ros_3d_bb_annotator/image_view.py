"""View of an image with boxes, samples and a cursor. Several views are linked by a SharedView."""
from ros_3d_bb_annotator import marking
from ros_3d_bb_annotator.qt import Qt, QtCore, QtGui, QtWidgets, Signal

BACKGROUND = QtGui.QColor(38, 40, 44)
WHEEL_STEP = 1.2
CURSOR_STEP_PX, PAN_STEP_PX = 10, 40
CLICK_PX = 4  # maximum movement of a click on the screen
ARROWS = {Qt.Key_Left: (-1, 0), Qt.Key_Right: (1, 0), Qt.Key_Up: (0, -1), Qt.Key_Down: (0, 1)}


class ImageView(QtWidgets.QWidget):
    """View of one image. If `image` is None, `message` is the reason. `box_chosen` is emitted with the index of a box.

    Wheel: zoom; drag: pan; click: select a box; Shift and drag, or drag while drawing: draw a box. Arrow keys move the
    cursor by 10 pixels (Ctrl: 1), Shift and arrow keys pan, Space sets the corners of a box, Escape cancels it.
    """

    box_chosen = Signal(int)

    def __init__(self, name, shared, parent=None):
        super(ImageView, self).__init__(parent)
        self._name, self._shared = name, shared
        self.image, self.message, self._scene, self._legend = None, '', marking.NOTHING, None
        self._pressed_at, self._panned_from = None, None
        self.setMouseTracking(True)
        self.setFocusPolicy(Qt.StrongFocus)
        self.setMinimumSize(240, 180)
        self.setAccessibleName('%s image' % name)
        shared.changed.connect(self.update)

    def sizeHint(self):  # noqa: N802 (Qt's name)
        return QtCore.QSize(640, 480)

    def show_image(self, image, scene, message='', legend=None):
        """Show a QImage with overlay (`marking.Scene`) and colour scale (QImage, top, bottom text), or a message."""
        self.image, self.message, self._scene, self._legend = image, message, scene, legend
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
        if self._shared.drawing or event.modifiers() & Qt.ShiftModifier:
            self._panned_from = None
            self._point_near(event)
            self._shared.corner = None
            self._shared.set_corner()

    def mouseMoveEvent(self, event):  # noqa: N802
        if self._pressed_at is not None and self._panned_from is not None:
            (old_x, old_y), (x, y) = self.to_image(self._panned_from), self.to_image(event.localPos())
            self._panned_from = event.localPos()
            self._shared.pan_by(old_x - x, old_y - y)
        elif self._shared.corner is not None:
            self._point_near(event)
        elif self.image is not None:
            self._shared.point_at(*self._pixel(event))

    def mouseReleaseEvent(self, event):  # noqa: N802
        if event.button() != Qt.LeftButton or self._pressed_at is None:
            return
        moved = (event.localPos() - self._pressed_at).manhattanLength()
        clicked = self._panned_from is not None and moved <= CLICK_PX
        self._pressed_at = self._panned_from = None
        if self._shared.corner is not None:
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

    def _pixel(self, event):
        return tuple(int(value // 1) for value in self.to_image(event.localPos()))

    def _point_near(self, event):
        """Move the cursor to the mouse position, clipped to the image."""
        self._shared.point_at(*(min(max(value, 0), size - 1)
                                for value, size in zip(self._pixel(event), self._shared.size)))
