"""Shared state of the views of a measurement: visible part of the image, cursor, and box that is being drawn."""
from ros_3d_bb_annotator.qt import QtCore, Signal

MIN_ZOOM, MAX_ZOOM = 1.0, 40.0
MIN_BOX_PX = 4  # smaller boxes are ignored


class SharedView(QtCore.QObject):
    """State of linked views of images of one size.

    Image coordinates are continuous: pixel (u, v) covers u..u+1 and v..v+1. `center` is the point in the centre of the
    view as shares 0..1 of width and height. `cursor` and `corner`, the first corner of a box that is being drawn, are
    pixels (u, v) or None. `edited` is the box that is being moved or resized, [x1, y1, x2, y2], or None. `changed`:
    views must be repainted; `box_drawn`: (x1, y1, x2, y2) in pixels, and whether it is a new box, not the edited one.
    """

    changed = Signal()
    pointed = Signal()
    box_drawn = Signal(object, bool)

    def __init__(self, parent=None):
        super(SharedView, self).__init__(parent)
        self.size = (640, 480)
        self.zoom, self.center = MIN_ZOOM, (0.5, 0.5)
        self.cursor, self.corner, self.edited = None, None, None

    def show_size(self, width, height):
        """Set the size of the images in pixels. Zoom and position are kept."""
        self.size = (width, height)
        if self.cursor is not None and not self._is_inside(self.cursor):
            self.cursor = None

    def zoom_by(self, factor, anchor):
        """Zoom around the point `anchor` (x, y) of the image."""
        shares = tuple(value / size for value, size in zip(anchor, self.size))
        zoom = min(max(self.zoom * factor, MIN_ZOOM), MAX_ZOOM)
        center = tuple(share + (center - share) * self.zoom / zoom for share, center in zip(shares, self.center))
        self.zoom = zoom
        self._move_center(center)

    def pan_by(self, x_px, y_px):
        """Move the visible part by pixels of the image."""
        self._move_center((self.center[0] + x_px / self.size[0], self.center[1] + y_px / self.size[1]))

    def fit(self):
        self.zoom, self.center = MIN_ZOOM, (0.5, 0.5)
        self.changed.emit()

    def point_at(self, u, v):
        """Move the cursor to a pixel, or remove it if the pixel is outside the image."""
        self.cursor = (int(u), int(v)) if self._is_inside((u, v)) else None
        self.pointed.emit()
        self.changed.emit()

    def start_drawing(self):
        """Start to draw a box at the cursor."""
        self.corner = self.cursor
        self.changed.emit()

    def start_editing(self, box_px):
        """Start to move or resize a box (x1, y1, x2, y2)."""
        self.edited = list(box_px)
        self.changed.emit()

    def nudge(self, edges, columns, rows):
        """Move edges of the box that is being edited, a subset of (0, 1, 2, 3), by pixels."""
        for edge in edges:
            limit = self.size[edge % 2]
            self.edited[edge] = min(max(self.edited[edge] + (rows if edge % 2 else columns), 0), limit)
        self.changed.emit()

    def finish(self):
        """Complete the box that is being drawn or edited, unless it is tiny."""
        x1, y1, x2, y2 = box_px = self.rubber_band()
        is_new = self.edited is None
        self.cancel()
        if min(x2 - x1, y2 - y1) >= MIN_BOX_PX:
            self.box_drawn.emit(box_px, is_new)

    def cancel(self):
        self.corner = self.edited = None
        self.changed.emit()

    def rubber_band(self):
        """Box that is being drawn or edited, (x1, y1, x2, y2), including the pixels of both corners, or None."""
        if self.edited is not None:
            x1, y1, x2, y2 = self.edited
            return min(x1, x2), min(y1, y2), max(x1, x2), max(y1, y2)
        if self.corner is None or self.cursor is None:
            return None
        (u1, v1), (u2, v2) = self.corner, self.cursor
        return min(u1, u2), min(v1, v2), max(u1, u2) + 1, max(v1, v2) + 1

    def _is_inside(self, pixel):
        return all(0 <= value < size for value, size in zip(pixel, self.size))

    def _move_center(self, center):
        """Move the visible part, which stays inside the image."""
        margin = 0.5 / self.zoom
        self.center = tuple(min(max(share, margin), 1 - margin) for share in center)
        self.changed.emit()
