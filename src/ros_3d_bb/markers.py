"""Tracks as RViz markers, drawn as in the thesis (Fig. 4.1)."""
import genpy
import numpy as np
from geometry_msgs.msg import Point
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

CYLINDER, ID, VELOCITY, PREDICTION = NAMESPACES = ('cylinder', 'id', 'velocity', 'prediction')
BLUE = ColorRGBA(0.1, 0.3, 1.0, 0.5)
GREEN = ColorRGBA(0.1, 0.9, 0.2, 1.0)
RED = ColorRGBA(0.95, 0.1, 0.1, 1.0)
VELOCITY_SHOWN_S = 1.0  # the velocity arrow ends where the object would be after so long
SHORTEST_ARROW_M = 0.05  # RViz cannot orient an arrow without length


class MarkerWriter(object):
    """Draws tracks, one namespace for each kind of marker and the track's id as the marker's.

    A marker is replaced in place while its track lives and deleted when it ends; where no news comes at all, RViz
    removes it after `lifetime_s` (0: never).
    """

    def __init__(self, lifetime_s):
        self._lifetime = genpy.Duration.from_sec(lifetime_s)
        self._drawn = set()

    def write(self, tracks, header):
        """The markers for one image: a blue cylinder, the id above it, a red velocity and a green prediction arrow.

        Parameters
        ----------
        tracks : list of tracked.TrackedObject
        header : std_msgs.msg.Header
            Stamp of the image and fixed frame.

        Returns
        -------
        visualization_msgs.msg.MarkerArray
        """
        self._header = header
        markers = [marker for track in tracks for marker in self._track(track)]
        alive = set(track.id for track in tracks)
        for track_id in sorted(self._drawn - alive):
            markers += [self._marker(namespace, track_id, action=Marker.DELETE) for namespace in NAMESPACES]
        self._drawn = alive
        return MarkerArray(markers=markers)

    def _track(self, track):
        cylinder = self._marker(CYLINDER, track.id, type=Marker.CYLINDER, color=BLUE)
        cylinder.pose.position = Point(*track.position_m)
        cylinder.scale.x, cylinder.scale.y, cylinder.scale.z = track.size_m
        text = self._marker(ID, track.id, type=Marker.TEXT_VIEW_FACING, color=GREEN, text=str(track.id))
        text.pose.position = Point(*(track.position_m + [0, 0, track.size_m[2] / 2 + 0.2]))
        text.scale.z = 0.35
        velocity_end = track.position_m + VELOCITY_SHOWN_S * track.instant_velocity_mps
        prediction_end = track.prediction_m[-1] if len(track.prediction_m) else track.position_m
        return [cylinder, text, self._arrow(VELOCITY, track, velocity_end, RED),
                self._arrow(PREDICTION, track, prediction_end, GREEN)]

    def _arrow(self, namespace, track, end, color):
        """From the centre of the object to `end`; removed where it has no length."""
        if np.linalg.norm(end - track.position_m) < SHORTEST_ARROW_M:
            return self._marker(namespace, track.id, action=Marker.DELETE)
        arrow = self._marker(namespace, track.id, type=Marker.ARROW, color=color)
        arrow.points = [Point(*track.position_m), Point(*end)]
        arrow.scale.x, arrow.scale.y = 0.06, 0.14
        return arrow

    def _marker(self, namespace, track_id, **fields):
        marker = Marker(header=self._header, ns=namespace, id=track_id, lifetime=self._lifetime, **fields)
        marker.pose.orientation.w = 1.0
        return marker
