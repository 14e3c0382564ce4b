"""RViz markers of tracks: cylinders and arrows as in Fig. 4.1 of the thesis, histories, and ellipses of covariances."""
import functools
from typing import NamedTuple

import genpy
import numpy as np
from geometry_msgs.msg import Point
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

from ros_3d_bb.core.labels import described
from ros_3d_bb.core.params import Param, parameters
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.tracking.types import OCCLUDED, OUT_OF_VIEW, VISIBLE

MARKERS_TOPIC = 'visualization_marker_array'
NAMESPACES = 'cylinder', 'id', 'velocity', 'prediction', 'history', 'ellipse', 'prediction_ellipse'
BLUE, GREEN, RED = (0.1, 0.3, 1.0), (0.1, 0.9, 0.2), (0.95, 0.1, 0.1)
AMBER, GREY, WHITE = (1.0, 0.65, 0.1), (0.65, 0.65, 0.65), (0.95, 0.95, 0.95)
# Neighbours differ most. None is red, green or grey, because arrows and tracks that are not visible have these colours.
PALETTE = ((0.15, 0.4, 1.0), (1.0, 0.6, 0.1), (0.9, 0.35, 0.9), (0.1, 0.8, 0.85), (0.95, 0.9, 0.25),
           (0.55, 0.3, 0.95), (1.0, 0.6, 0.65), (0.6, 0.8, 1.0), (0.7, 0.45, 0.2), (0.75, 0.65, 1.0))
STATUS_COLORS = {VISIBLE: BLUE, OCCLUDED: AMBER, OUT_OF_VIEW: GREY}
TEXT_COLORS = {'id': WHITE, 'status': WHITE, 'thesis': GREEN}  # by ~marker_color
VELOCITY_SHOWN_S = 1.0  # the velocity arrow ends at the position after this time
MIN_ARROW_M = 0.05  # RViz cannot orient an arrow without length
# Diameters of shaft and head. If both arrows have the same direction, the tip of the thin one remains visible.
VELOCITY_WIDTHS_M, PREDICTION_WIDTHS_M = (0.07, 0.14), (0.04, 0.11)
CHI2_95 = 5.991  # 95 % quantile of chi squared with 2 degrees of freedom: squared semi-axes in standard deviations
CIRCLE = np.array([(np.cos(angle), np.sin(angle)) for angle in np.linspace(0, 2 * np.pi, 25)])
ELLIPSES_EVERY_S = 0.5  # along the prediction
FLOOR_OFFSET_M = 0.02  # avoids flickering of lines in the plane of RViz's grid
HISTORY_POINTS, HISTORY_SPACING_S = 100, 0.1  # maximum number, minimum distance


@parameters('what RViz shows')
class MarkerParams(NamedTuple):
    """Which markers tracker_node publishes, and how they look."""

    marker_namespaces: list = Param(
        NAMESPACES[:-1], 'Kinds of markers, each in a namespace of its own that RViz switches on and off. cylinder; '
        'id: the track ID, with the class of objects other than people, followed by a question mark while the object '
        'is not detected; velocity: red, to the position in 1 s; prediction: green, to the last predicted position; '
        'history: the path walked, fading; '
        'ellipse: contains the position with a probability of 95 %; prediction_ellipse: the same at each half second '
        'ahead.', choices=NAMESPACES, live=True)
    marker_color: str = Param(
        'id', 'Colour of cylinders, history and ellipses. id: one of ten colours by track ID, which shows ID '
        'switches; status: blue for visible, amber for occluded, grey for out of view; thesis: blue. Undetected '
        'people are paler.', choices=tuple(TEXT_COLORS), live=True)
    marker_history: float = Param(4.0, 'Length of the history; 0: none.', 's', live=(0, 30))
    marker_lifetime: float = Param(
        2.0, 'RViz removes markers that are not updated for this long; 0: never.', 's', live=(0, 10))


class MarkerWriter(object):
    """Converts tracks to markers, with one namespace per kind of marker. The ID of a marker is that of its track.

    Points are relative to the pose of the marker, which is close to them. RViz transforms poses in float64 but points
    in float32, which would be rounded to half a metre on a map in UTM coordinates.

    A marker is updated while its track exists, and deleted when the track ends. Without new messages RViz removes it
    after its lifetime (0: never).
    """

    def __init__(self, params=MarkerParams()):
        self._drawn = set()  # (namespace, id)
        self._histories = {}  # by track ID: an anchor (3,), and the path relative to it, [(stamp_ns, Point)]
        self.reconfigure(params)

    def reconfigure(self, params):
        """Draw the next tracks with other parameters."""
        self._params = params
        self._lifetime = genpy.Duration.from_sec(params.marker_lifetime)
        shapes = (self._cylinder, self._id, self._velocity, self._prediction, self._history, self._ellipse,
                  self._prediction_ellipses)
        self._shapes = [(name, shape) for name, shape in zip(NAMESPACES, shapes) if name in params.marker_namespaces]

    def write(self, tracks, header):
        """Create the visualization_msgs/MarkerArray of the tracks (`types.TrackedObject`) of one image; the header has
        its stamp and the fixed frame."""
        now_ns = header.stamp.to_nsec()
        self._histories = {track.id: self._extended_history(track, now_ns) for track in tracks}
        markers = []
        for track in tracks:
            for namespace, shape in self._shapes:
                marker = Marker(header=header, ns=namespace, id=track.id, lifetime=self._lifetime)
                marker.pose.position, marker.pose.orientation.w = Point(*track.position_m), 1.0
                if shape(marker, track):
                    markers.append(marker)
        drawn = {(marker.ns, marker.id) for marker in markers}
        markers += [Marker(header=header, ns=namespace, id=track_id, action=Marker.DELETE)
                    for namespace, track_id in sorted(self._drawn - drawn)]
        self._drawn = drawn
        return MarkerArray(markers=markers)

    def _extended_history(self, track, now_ns):
        """History of a track with its current position, without steps that a jump back in time makes future ones."""
        oldest_ns = now_ns - int(self._params.marker_history * NS)
        foot_m = track.position_m + _to_foot(track)
        anchor_m, steps = self._histories.get(track.id, (foot_m, []))
        steps = [step for step in steps if oldest_ns <= step[0] < now_ns]
        spacing_s = max(HISTORY_SPACING_S, self._params.marker_history / HISTORY_POINTS)
        if len(steps) > 1 and steps[-1][0] - steps[-2][0] < spacing_s * NS:
            steps.pop()
        if not steps:
            anchor_m = foot_m
        return anchor_m, steps + [(now_ns, Point(*(foot_m - anchor_m)))]

    # Each shape fills in a marker and returns whether there is anything to draw.

    def _cylinder(self, marker, track):
        marker.type, marker.color = Marker.CYLINDER, _color(self._rgb(track), 0.65 if track.status == VISIBLE else 0.2)
        marker.scale.x, marker.scale.y, marker.scale.z = track.size_m
        return True

    def _id(self, marker, track):
        marker.type, marker.scale.z = Marker.TEXT_VIEW_FACING, 0.35
        marker.pose.position = Point(*(track.position_m + [0, 0, track.size_m[2] / 2 + 0.2]))
        is_visible = track.status == VISIBLE
        marker.text = described(track.label, '%d' % track.id if is_visible else '%d?' % track.id)
        marker.color = _color(TEXT_COLORS[self._params.marker_color] if is_visible else GREY, 1.0)
        return True

    def _velocity(self, marker, track):
        return _fill_arrow(marker, track, VELOCITY_SHOWN_S * track.instant_velocity_mps, RED, VELOCITY_WIDTHS_M)

    def _prediction(self, marker, track):
        offset_m = track.prediction_m[-1] - track.position_m if len(track.prediction_m) else np.zeros(3)
        return _fill_arrow(marker, track, offset_m, GREEN, PREDICTION_WIDTHS_M)

    def _history(self, marker, track):
        anchor_m, steps = self._histories[track.id]
        if len(steps) < 2:
            return False
        marker.type, marker.scale.x, marker.pose.position = Marker.LINE_STRIP, 0.05, Point(*anchor_m)
        rgb, now_ns, fading = self._rgb(track), steps[-1][0], 0.85 / (self._params.marker_history * NS)
        marker.color = _color(rgb, 0.9)  # not 1: RViz would draw the whole line opaque
        marker.points = [point for _stamp_ns, point in steps]
        marker.colors = [_color(rgb, round(0.9 - fading * (now_ns - stamp_ns), 2)) for stamp_ns, _point in steps]
        return True

    def _ellipse(self, marker, track):
        if track.covariance is None:
            return False
        marker.type, marker.scale.x, marker.color = Marker.LINE_STRIP, 0.03, _color(self._rgb(track), 0.9)
        marker.points, = _ellipses(track.covariance[np.newaxis, :2, :2], _to_foot(track)[np.newaxis])
        return True

    def _prediction_ellipses(self, marker, track):
        if track.prediction_covariance_m2 is None or not len(track.prediction_m):
            return False
        stride = max(int(round(ELLIPSES_EVERY_S / track.prediction_step_s)), 1)
        shown = np.s_[stride - 1::stride]
        feet_m = track.prediction_m[shown] - track.position_m + _to_foot(track)
        marker.type, marker.scale.x, marker.color = Marker.LINE_LIST, 0.015, _color(GREEN, 0.6)
        for outline in _ellipses(track.prediction_covariance_m2[shown, :2, :2], feet_m):
            marker.points += [point for ends in zip(outline, outline[1:]) for point in ends]
        return bool(marker.points)

    def _rgb(self, track):
        if self._params.marker_color == 'status':
            return STATUS_COLORS[track.status]
        return PALETTE[(track.id - 1) % len(PALETTE)] if self._params.marker_color == 'id' else BLUE


def _to_foot(track):
    """Vector from the centre of a track to its foot, just above the floor."""
    return np.array([0, 0, FLOOR_OFFSET_M - track.size_m[2] / 2])


def _fill_arrow(marker, track, offset_m, rgb, widths_m):
    """Make the marker an arrow from the centre of the track along `offset_m`."""
    marker.type, marker.color = Marker.ARROW, _color(rgb, 1.0 if track.status == VISIBLE else 0.4)
    marker.points = [Point(), Point(*offset_m)]
    marker.scale.x, marker.scale.y = widths_m
    return np.linalg.norm(offset_m) >= MIN_ARROW_M


def _ellipses(covariances_m2, centers_m):
    """Closed outlines of the 95 % confidence ellipses of covariances (n, 2, 2) at centres (n, 3), as lists of Point."""
    variances_m2, axes = np.linalg.eigh(covariances_m2)
    semi_axes_m = np.sqrt(CHI2_95 * np.maximum(variances_m2, 0))
    offsets_m = np.matmul(CIRCLE * semi_axes_m[:, np.newaxis], axes.transpose(0, 2, 1))
    outlines_m = (offsets_m + centers_m[:, np.newaxis, :2]).tolist()
    return [[Point(x, y, z) for x, y in outline_m] for outline_m, z in zip(outlines_m, centers_m[:, 2].tolist())]


@functools.lru_cache(maxsize=None)
def _color(rgb, alpha):
    """Colour message. Markers share these messages, which must not be modified."""
    return ColorRGBA(*(rgb + (alpha,)))
