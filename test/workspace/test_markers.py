"""Markers: the same ones in place while a track lives, gone when it ends."""
import numpy as np
import pytest
from std_msgs.msg import Header
from visualization_msgs.msg import Marker

from ros_3d_bb.markers import NAMESPACES, MarkerWriter
from ros_3d_bb.messages import time_from
from ros_3d_bb.tracking.tracked import VISIBLE, TrackedObject

HEADER = Header(stamp=time_from(7), frame_id='map')


def track(number, velocity=(1.0, 0.0, 0.0), steps=8):
    position, velocity = np.array([2.0, 1.0, 0.9]), np.array(velocity)
    prediction = position + np.arange(1, steps + 1)[:, None] * 0.25 * velocity
    return TrackedObject(number, position, np.array([0.5, 0.5, 1.7]), velocity, velocity, VISIBLE, True, 0, 7,
                         prediction, 0.25)


def keys(markers, action=Marker.ADD):
    return [(marker.ns, marker.id) for marker in markers.markers if marker.action == action]


def test_each_track_has_one_marker_in_each_namespace():
    markers = MarkerWriter(2.0).write([track(3), track(5)], HEADER)
    assert sorted(keys(markers)) == sorted((namespace, number) for namespace in NAMESPACES for number in (3, 5))
    assert all(marker.header == HEADER and marker.lifetime.to_sec() == 2.0 for marker in markers.markers)


def test_markers_of_a_living_track_are_replaced_and_never_deleted():
    writer = MarkerWriter(0.0)
    first, second = writer.write([track(1)], HEADER), writer.write([track(1)], HEADER)
    assert keys(first) == keys(second) and keys(second, Marker.DELETE) == []


def test_markers_of_an_ended_track_are_deleted_once():
    writer = MarkerWriter(2.0)
    writer.write([track(1), track(2)], HEADER)
    assert sorted(keys(writer.write([track(2)], HEADER), Marker.DELETE)) == [(name, 1) for name in sorted(NAMESPACES)]
    assert keys(writer.write([track(2)], HEADER), Marker.DELETE) == []


def test_an_object_that_stands_has_no_arrows():
    markers = MarkerWriter(2.0).write([track(1, (0.0, 0.0, 0.0))], HEADER)
    assert keys(markers) == [('cylinder', 1), ('id', 1)]
    assert sorted(keys(markers, Marker.DELETE)) == [('prediction', 1), ('velocity', 1)]


def test_a_track_without_prediction_is_drawn():
    markers = MarkerWriter(2.0).write([track(1, steps=0)], HEADER)
    assert ('prediction', 1) not in keys(markers) and ('velocity', 1) in keys(markers)


def test_arrows_end_where_the_object_is_after_one_and_two_seconds():
    drawn = {marker.ns: marker for marker in MarkerWriter(2.0).write([track(1, (0.5, -1.0, 0.0))], HEADER).markers}
    for namespace, end in (('velocity', (2.5, 0.0)), ('prediction', (3.0, -1.0))):
        start, tip = drawn[namespace].points
        assert (start.x, start.y, start.z) == (2.0, 1.0, 0.9) and (tip.x, tip.y) == pytest.approx(end)
