"""Window content of viewer_node: colour, depth and boxes of one image side by side, and lines of text below.

Images are (height, width, 3), uint8, RGB.
"""
import collections

import cv2
import numpy as np

from ros_3d_bb.core.object_classes import described
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.visualization.image_overlay import colorize_depth, draw_boxes, depth_to_grey

PAPER, INK, WARNING_INK = (32, 32, 32), (235, 235, 235), (255, 190, 60)
FONT, FONT_SCALE, LINE_PX, MARGIN_PX = cv2.FONT_HERSHEY_SIMPLEX, 0.45, 20, 8
BAR_WIDTH_PX, BAR_TOP_PX = 14, 16
MIN_TEXT_LINES = 8  # keeps the size of the window constant for a few people
RATE_WINDOW_NS = 2 * NS  # interval for the frame rate
TITLES = ('colour', 'depth', 'boxes')


class FrameRate(object):
    """Rate of images by the clock of the caller."""

    def __init__(self):
        self._arrivals_ns = collections.deque()

    def add(self, arrival_ns):
        self._arrivals_ns.append(arrival_ns)
        self.at(arrival_ns)  # limits the memory if the rate is never read

    def at(self, now_ns):
        """Recent number of images per second; 0 if fewer than two have arrived."""
        while self._arrivals_ns and self._arrivals_ns[0] < now_ns - RATE_WINDOW_NS:
            self._arrivals_ns.popleft()
        if len(self._arrivals_ns) < 2:
            return 0.0
        return (len(self._arrivals_ns) - 1) * NS / max(1, self._arrivals_ns[-1] - self._arrivals_ns[0])


def compose(snapshot, panel_width_px, farthest_m, lines=(), warnings=()):
    """Draw a `snapshots.Snapshot`, with lines of text and highlighted warnings below.

    The three panels have the width `panel_width_px`; depth is colour-coded up to `farthest_m`.
    """
    height, width = snapshot.color.pixels.shape[:2]
    size_px = (panel_width_px, max(1, int(round(height * panel_width_px / width))))
    color = cv2.resize(np.ascontiguousarray(snapshot.color.pixels), size_px, interpolation=cv2.INTER_LINEAR)
    # depth must not be interpolated
    grey = cv2.resize(depth_to_grey(snapshot.depth, farthest_m), size_px, interpolation=cv2.INTER_NEAREST)
    panels = [color, _with_range_bar(colorize_depth(grey), farthest_m), _annotated(color.copy(), snapshot)]
    for panel, title in zip(panels, TITLES):
        _write(panel, title, (MARGIN_PX, panel.shape[0] - MARGIN_PX))  # labels of boxes are at the top
    row = np.concatenate(panels, axis=1)
    lines = tuple(lines) + box_lines(snapshot.boxes3d or ())
    return np.concatenate((row, text_image(lines, warnings, row.shape[1])))


def _with_range_bar(image, farthest_m):
    """Draw the colour scale of depth along the right border, near at the bottom, labelled in metres."""
    height, width = image.shape[:2]
    left, right, bottom = width - MARGIN_PX - BAR_WIDTH_PX, width - MARGIN_PX, height - BAR_TOP_PX
    grey = np.rint(np.linspace(1, 255, bottom - BAR_TOP_PX)).astype(np.uint8)
    image[BAR_TOP_PX:bottom, left:right] = colorize_depth(np.repeat(grey[:, None], BAR_WIDTH_PX, axis=1))
    for metres in range(0, int(farthest_m) + 1, max(1, int(farthest_m) // 6)):
        row = bottom - int(round(metres / farthest_m * (bottom - BAR_TOP_PX)))
        cv2.line(image, (left - 4, row), (left, row), INK, 1)
        text = '%d m' % metres
        text_width = cv2.getTextSize(text, FONT, FONT_SCALE, 1)[0][0]
        _write(image, text, (left - 6 - text_width, row + 5))
    return image


def box_lines(boxes):
    """One line per 3D box: its class if it is not a person, number as in the image, position in the camera's optical
    frame, width and height, and its score if it is known."""
    return tuple(described(box.label, '%d: x %+.2f  y %+.2f  z %.2f m,  %.2f m wide, %.2f m high%s%s' % (
        (number,) + tuple(box.center_m) + tuple(box.size_m[:2])
        + (', score %.2f' % box.score if box.score else '', ', truncated' if box.truncated else '')))
                 for number, box in enumerate(boxes, 1))


def _annotated(panel, snapshot):
    """Draw 3D boxes with number and distance, and 2D boxes without a 3D box."""
    boxes = snapshot.boxes3d or ()
    located = set(tuple(box.rect_px) for box in boxes)
    height, width = snapshot.color.pixels.shape[:2]
    inside_px = np.clip(np.reshape(snapshot.boxes2d or (), (-1, 4)).astype(int), 0, [width, height] * 2).tolist()
    without_position = [rect_px for rect_px in inside_px if tuple(rect_px) not in located]
    rects_px = np.array([box.rect_px for box in boxes] + without_position, float).reshape(-1, 4)
    labels = [described(box.label, '%d: %.2f m' % (number, box.center_m[2])) for number, box in enumerate(boxes, 1)]
    return draw_boxes(panel, rects_px * (panel.shape[1] / width), labels + ['no position'] * len(without_position))


def draw_countdown(picture, text):
    """Draw a short text that can be read from afar. Returns the picture."""
    if text:
        height_px = picture.shape[0] // 3
        scale = height_px / cv2.getTextSize(text, FONT, 1, 1)[0][1]
        for ink, thickness in (((0, 0, 0), 7), (WARNING_INK, 3)):
            cv2.putText(picture, text, (MARGIN_PX * 4, height_px + MARGIN_PX * 4), FONT, scale, ink,
                        max(1, int(thickness * scale / 2)), cv2.LINE_AA)
    return picture


def text_image(lines, warnings, width_px):
    rows = [(line, INK) for line in lines] + [(line, WARNING_INK) for line in warnings]
    image = np.full((LINE_PX * max(MIN_TEXT_LINES, len(rows)) + 2 * MARGIN_PX, width_px, 3), PAPER, np.uint8)
    for number, (line, color) in enumerate(rows, 1):
        cv2.putText(image, line, (MARGIN_PX, LINE_PX * number), FONT, FONT_SCALE, color, 1, cv2.LINE_AA)
    return image


def _write(image, text, place_px):
    for ink, thickness in (((0, 0, 0), 3), (INK, 1)):
        cv2.putText(image, text, place_px, FONT, FONT_SCALE, ink, thickness, cv2.LINE_AA)
