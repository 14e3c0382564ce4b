"""RViz markers of tracks: cylinders and arrows as in Fig. 4.1 of the thesis, histories, and ellipses of covariances."""
import functools
from typing import NamedTuple, Optional, Sequence

import genpy
import numpy as np
from geometry_msgs.msg import Point, Pose, Quaternion, Vector3
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

from ros_3d_bb.core.object_classes import described
from ros_3d_bb.core.params import Param, parameters
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.tracking.types import OCCLUDED, OUT_OF_VIEW, VISIBLE

MARKERS_TOPIC = 'visualization_marker_array'
NAMESPACES = ('cylinder', 'id', 'velocity', 'prediction', 'history', 'ellipse', 'ignored_area', 'field_of_view')
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
VELOCITY_SCALE, PREDICTION_SCALE = Vector3(0.07, 0.14, 0), Vector3(0.04, 0.11, 0)
# Height of the text, and widths of the lines.
TEXT_SCALE, HISTORY_SCALE = Vector3(0, 0, 0.5), Vector3(0.05, 0, 0)
ELLIPSE_SCALE = Vector3(0.03, 0, 0)
AREA, VIEW = 'ignored_area', 'field_of_view'
OUTLINE_SCALES = {AREA: Vector3(0.06, 0, 0), VIEW: Vector3(0.03, 0, 0)}
UPRIGHT = Quaternion(0, 0, 0, 1)
CHI2_95 = 5.991  # 95 % quantile of chi squared with 2 degrees of freedom: squared semi-axes in standard deviations
CIRCLE = np.array([(np.cos(angle), np.sin(angle)) for angle in np.linspace(0, 2 * np.pi, 17)])
FLOOR_OFFSET_M = 0.02  # avoids flickering of lines in the plane of RViz's grid
HISTORY_POINTS, HISTORY_SPACING_S = 50, 0.2  # maximum number, minimum distance


@parameters('what RViz shows')
class MarkerParams(NamedTuple):
    """Which markers tracker_node publishes, and how they look."""

    marker_namespaces: list = Param(
        NAMESPACES, 'Kinds of markers, each in a namespace of its own that RViz switches on and off. cylinder; id: the '
        'track ID, with the class of objects other than people, followed by a question mark while the object is not '
        'detected; velocity: red, to the position in 1 s; prediction: green, to the last predicted position; history: '
        'the path walked, fading; ellipse: contains the position with a probability of 95 %; ignored_area: where no '
        'track starts (ignored_areas); field_of_view: of the camera, on the floor.', choices=NAMESPACES, live=True)
    marker_color: str = Param(
        'id', 'Colour of cylinders, history and ellipses. id: one of ten colours by track ID, which shows ID '
        'switches; status: blue for visible, amber for occluded, grey for out of view; thesis: blue. Undetected '
        'people are paler.', choices=tuple(TEXT_COLORS), live=True)
    marker_history: float = Param(4.0, 'Length of the history; 0: none.', 's', live=(0, 30))
    marker_lifetime: float = Param(
        2.0, 'RViz removes markers that are not updated for this long; 0: never.', 's', live=(0, 10))


class _Look(NamedTuple):
    """The fields in which the markers of a track differ, see visualization_msgs/Marker.

    `pose` is None for the centre of the track. Markers share messages, which must not be modified.
    """

    type: int
    scale: Vector3
    color: ColorRGBA
    pose: Optional[Pose] = None
    points: Sequence[Point] = ()
    colors: Sequence[ColorRGBA] = ()
    text: str = ''


class MarkerWriter(object):
    """Converts tracks to markers, with one namespace per kind of marker. The ID of a marker is that of its track.

    Points are relative to the pose of the marker, which is close to them. RViz transforms poses in float64 but points
    in float32, which would be rounded to half a metre on a map in UTM coordinates.

    A marker is updated while its track exists, and deleted when the track ends. Without new messages RViz removes it
    after its lifetime (0: never).

    Attributes, in the fixed frame: `areas_m`, polygons (n, 2) in which no track starts, and `views_m`, those that the
    cameras see.
    """

    def __init__(self, params=MarkerParams()):
        self._drawn = set()  # (namespace, id)
        self._histories = {}  # by track ID: an anchor (3,), and the path relative to it, [(stamp_ns, Point)]
        self._outlines = {}  # of the ellipses, by track ID
        self.areas_m = self.views_m = ()
        self.reconfigure(params)

    def reconfigure(self, params):
        """Draw the next tracks with other parameters."""
        self._params = params
        self._lifetime = genpy.Duration.from_sec(params.marker_lifetime)
        shapes = {'cylinder': self._cylinder, 'id': self._id, 'velocity': self._velocity,
                  'prediction': self._prediction, 'history': self._history, 'ellipse': self._ellipse}
        self._shapes = [(name, shape) for name, shape in shapes.items() if name in params.marker_namespaces]

    def write(self, tracks, header):
        """Create the visualization_msgs/MarkerArray of the tracks (`types.TrackedObject`) of one image; the header has
        its stamp and the fixed frame."""
        now_ns = header.stamp.to_nsec()
        self._histories = {track.id: self._extended_history(track, now_ns) for track in tracks}
        self._outlines = _outlines_of(tracks) if 'ellipse' in self._params.marker_namespaces else {}
        markers = []
        for track in tracks:
            pose = _pose(track.position_m)
            for namespace, shape in self._shapes:
                look = shape(track)
                if look is not None:
                    markers.append(Marker(header, namespace, track.id, look.type, Marker.ADD, look.pose or pose,
                                          look.scale, look.color, self._lifetime, False, look.points, look.colors,
                                          look.text, '', False))
        for namespace, polygons_m in ((AREA, self.areas_m), (VIEW, self.views_m)):
            if namespace in self._params.marker_namespaces:
                markers += [self._outline(namespace, number, polygon_m, header)
                            for number, polygon_m in enumerate(polygons_m)]
        drawn = {(marker.ns, marker.id) for marker in markers}
        markers += [Marker(header=header, ns=namespace, id=track_id, action=Marker.DELETE)
                    for namespace, track_id in sorted(self._drawn - drawn)]
        self._drawn = drawn
        return MarkerArray(markers=markers)

    def _outline(self, namespace, number, polygon, header):
        anchor_m = np.append(polygon[0], FLOOR_OFFSET_M)
        corners = [_point(x, y, 0.0) for x, y in (np.vstack((polygon, polygon[:1])) - polygon[0]).tolist()]
        return Marker(header=header, ns=namespace, id=number, type=Marker.LINE_STRIP, action=Marker.ADD,
                      pose=_pose(anchor_m), scale=OUTLINE_SCALES[namespace], color=_color(GREY, 0.9),
                      lifetime=self._lifetime,
                      points=corners)

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
        return anchor_m, steps + [(now_ns, _point(*(foot_m - anchor_m).tolist()))]

    # Each shape returns the `_Look` of its marker, None if there is nothing to draw.

    def _cylinder(self, track):
        return _Look(Marker.CYLINDER, Vector3(*track.size_m.tolist()),
                     _color(self._rgb(track), 0.65 if track.status == VISIBLE else 0.2))

    def _id(self, track):
        is_visible, (x, y, z) = track.status == VISIBLE, track.position_m.tolist()
        return _Look(Marker.TEXT_VIEW_FACING, TEXT_SCALE,
                     _color(TEXT_COLORS[self._params.marker_color] if is_visible else GREY, 1.0),
                     text=described(track.label, '%d' % track.id if is_visible else '%d?' % track.id),
                     pose=Pose(_point(x, y, z + (float(track.size_m[2]) / 2 + 0.2)), UPRIGHT))

    def _velocity(self, track):
        return _arrow(track, VELOCITY_SHOWN_S * track.velocity_mps, RED, VELOCITY_SCALE)

    def _prediction(self, track):
        if not len(track.prediction_m):
            return None
        return _arrow(track, track.prediction_m[-1] - track.position_m, GREEN, PREDICTION_SCALE)

    def _history(self, track):
        anchor_m, steps = self._histories[track.id]
        if len(steps) < 2:
            return None
        stamps_ns, points = zip(*steps)
        now_ns, fading = stamps_ns[-1], 0.85 / (self._params.marker_history * NS)
        shades = _shades(self._rgb(track))
        return _Look(Marker.LINE_STRIP, HISTORY_SCALE, shades[0.9],  # not 1: RViz would draw the whole line opaque
                     points=points, pose=_pose(anchor_m),
                     colors=[shades[round(0.9 - fading * (now_ns - stamp_ns), 2)] for stamp_ns in stamps_ns])

    def _ellipse(self, track):
        if track.id not in self._outlines:
            return None
        return _Look(Marker.LINE_STRIP, ELLIPSE_SCALE, _color(self._rgb(track), 0.9), points=self._outlines[track.id])

    def _rgb(self, track):
        if self._params.marker_color == 'status':
            return STATUS_COLORS[track.status]
        return PALETTE[(track.id - 1) % len(PALETTE)] if self._params.marker_color == 'id' else BLUE


def _to_foot(track):
    return np.array([0, 0, FLOOR_OFFSET_M - track.size_m[2] / 2])


def _arrow(track, offset_m, rgb, scale):
    """The `_Look` of an arrow from the centre of the track along `offset_m`; None if it is too short."""
    if not np.linalg.norm(offset_m) >= MIN_ARROW_M:
        return None
    return _Look(Marker.ARROW, scale, _color(rgb, 1.0 if track.status == VISIBLE else 0.4),
                 points=[Point(), _point(*offset_m.tolist())])


def _outlines_of(tracks):
    """Outlines of the 95 % confidence ellipses of the positions of tracks, {track ID: list of Point}."""
    known = [track for track in tracks if track.covariance is not None]
    if not known:
        return {}
    outlines = _ellipses(np.array([track.covariance[:2, :2] for track in known]), np.array(list(map(_to_foot, known))))
    return {track.id: outline for track, outline in zip(known, outlines)}


def _ellipses(covariances_m2, centers_m):
    """Closed outlines of the 95 % confidence ellipses of covariances (n, 2, 2) at centres (n, 3), as lists of Point."""
    variances_m2, axes = np.linalg.eigh(covariances_m2)
    semi_axes_m = np.sqrt(CHI2_95 * np.maximum(variances_m2, 0))
    offsets_m = np.matmul(CIRCLE * semi_axes_m[:, np.newaxis], axes.transpose(0, 2, 1))
    outlines_m = (offsets_m + centers_m[:, np.newaxis, :2]).tolist()
    outlines = []
    for outline_m, z in zip(outlines_m, centers_m[:, 2].tolist()):
        outline = []
        for x, y in outline_m:
            point = Point()  # as `_point`, without as many calls
            point.x, point.y, point.z = x, y, z
            outline.append(point)
        outlines.append(outline)
    return outlines


def _pose(position_m):
    return Pose(_point(*position_m.tolist()), UPRIGHT)


def _point(x, y, z):
    """Create a Point. genpy's constructor with arguments takes several times as long."""
    point = Point()
    point.x, point.y, point.z = x, y, z
    return point


@functools.lru_cache(maxsize=None)
def _shades(rgb):
    return {percentage / 100: _color(rgb, percentage / 100) for percentage in range(101)}


@functools.lru_cache(maxsize=None)
def _color(rgb, alpha):
    """Colour message. Markers share these messages, which must not be modified."""
    return ColorRGBA(*(rgb + (alpha,)))
