"""What the views of one measurement share: the part of the image that is shown, the cursor and a box being drawn."""
from ros_3d_bb_annotator.qt import QtCore, Signal

LEAST_ZOOM, MOST_ZOOM, ZOOM_STEP = 1.0, 40.0, 1.4
LEAST_BOX_PX = 4  # smaller is a slip of the hand


class SharedView(QtCore.QObject):
    """The state behind linked views of images of one size.

    Image coordinates are continuous: pixel (u, v) covers u..u+1 and v..v+1. `zoom` is 1 where the whole image fits
    the view, `center` what is in the middle of the view, as shares 0..1 of width and height. `cursor` is a pixel
    (u, v) or None, `corner` the first corner of a box being drawn or None. Signals: `changed` whenever a view has to
    be drawn again, `pointed` when the cursor moved, `drawing_changed` when boxes begin or cease to be drawn,
    `box_drawn` with (x1, y1, x2, y2) in pixels.
    """

    changed = Signal()
    pointed = Signal()
    drawing_changed = Signal(bool)
    box_drawn = Signal(object)

    def __init__(self, parent=None):
        super(SharedView, self).__init__(parent)
        self.size = (640, 480)
        self.zoom, self.center = LEAST_ZOOM, (0.5, 0.5)
        self.cursor, self.corner, self.drawing = None, None, False

    def show_size(self, width, height):
        """Say how large the images are, in pixels; zoom and position stay where they fit."""
        self.size = (width, height)
        if self.cursor is not None and not self._is_inside(self.cursor):
            self.cursor = None

    def zoom_by(self, factor, anchor=None):
        """Zoom so that the point `anchor` of the image (x, y), by default the middle of the view, stays in place."""
        shares = self.center if anchor is None else tuple(value / size for value, size in zip(anchor, self.size))
        zoom = min(max(self.zoom * factor, LEAST_ZOOM), MOST_ZOOM)
        self.center = tuple(share + (center - share) * self.zoom / zoom for share, center in zip(shares, self.center))
        self.zoom = zoom
        self._stay_inside()

    def zoom_in(self):
        """Zoom in a step, towards the cursor."""
        self.zoom_by(ZOOM_STEP, self.cursor)

    def zoom_out(self):
        """Zoom out a step."""
        self.zoom_by(1 / ZOOM_STEP, self.cursor)

    def pan_by(self, x_px, y_px):
        """Move what is shown by pixels of the image."""
        self.center = (self.center[0] + x_px / self.size[0], self.center[1] + y_px / self.size[1])
        self._stay_inside()

    def fit(self):
        """Show the whole image."""
        self.zoom, self.center = LEAST_ZOOM, (0.5, 0.5)
        self.changed.emit()

    def point_at(self, u, v):
        """Put the cursor on a pixel; outside of the image there is none."""
        self.cursor = (int(u), int(v)) if self._is_inside((u, v)) else None
        self.pointed.emit()
        self.changed.emit()

    def step(self, columns, rows):
        """Move the cursor; it starts in the middle of what is shown, and what is shown follows it."""
        start = self.cursor or tuple(int(share * size) for share, size in zip(self.center, self.size))
        self.point_at(*(min(max(value + move, 0), size - 1)
                        for value, move, size in zip(start, (columns, rows), self.size)))
        half = 0.45 / self.zoom
        self.center = tuple(min(max(center, value / size - half), value / size + half)
                            for center, value, size in zip(self.center, self.cursor, self.size))
        self._stay_inside()

    def start_drawing(self, drawing=True):
        """Say whether a plain drag draws a box."""
        changed, self.drawing = drawing != self.drawing, drawing
        if not drawing:
            self.corner = None
        if changed:
            self.drawing_changed.emit(drawing)
        self.changed.emit()

    def set_corner(self):
        """The first corner at the cursor, or where there is one already, the second: the box is done."""
        if self.cursor is None:
            self.step(0, 0)
        if self.corner is None:
            self.corner = self.cursor
            self.changed.emit()
            return
        box_px = self.rubber_band()
        self.cancel()
        if min(box_px[2] - box_px[0], box_px[3] - box_px[1]) >= LEAST_BOX_PX:
            self.box_drawn.emit(box_px)

    def cancel(self):
        """Drop the box being drawn."""
        self.start_drawing(False)

    def rubber_band(self):
        """The box being drawn, (x1, y1, x2, y2), which holds the pixels of both corners; None where there is none."""
        if self.corner is None or self.cursor is None:
            return None
        (u1, v1), (u2, v2) = self.corner, self.cursor
        return min(u1, u2), min(v1, v2), max(u1, u2) + 1, max(v1, v2) + 1

    def _is_inside(self, pixel):
        return all(0 <= value < size for value, size in zip(pixel, self.size))

    def _stay_inside(self):
        margin = 0.5 / self.zoom
        self.center = tuple(min(max(share, margin), 1 - margin) for share in self.center)
        self.changed.emit()
