import numpy as np
import pytest
from visualization_msgs.msg import Marker

from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.tracking.types import OCCLUDED, VISIBLE
from ros_3d_bb.visualization.markers import (AREA, NAMESPACES as ALL_NAMESPACES, PALETTE, VIEW, MarkerParams,
                                             MarkerWriter)
from support.ros import header_at
from support.tracks import track_at

NAMESPACES = [name for name in ALL_NAMESPACES if name not in (AREA, VIEW)]  # of tracks
ALL = MarkerParams(marker_namespaces=NAMESPACES)
SECOND_NS = 1000 * NS


def track(number, velocity=(1.0, 0.0, 0.0), steps=8, variances=(0.04, 0.01), turn=0.0, status=VISIBLE,
          position=(2.0, 1.0, 0.9)):
    """Track at (2, 1) of 1.7 m height, whose covariance has the `variances` along axes rotated by `turn` radians."""
    made = track_at(position, velocity, number=number)
    covariance = predicted = None
    if variances:
        axes = np.array([[np.cos(turn), -np.sin(turn), 0], [np.sin(turn), np.cos(turn), 0], [0, 0, 1]])
        covariance = np.zeros((6, 6))
        covariance[:3, :3] = axes.dot(np.diag(variances + (0.01,))).dot(axes.T)
        predicted = np.array([step * covariance[:3, :3] for step in range(1, steps + 1)]).reshape(-1, 3, 3)
    return made._replace(status=status, prediction_m=made.prediction_m[:steps], covariance=covariance,
                         prediction_covariance_m2=predicted)


def keys(markers, action=Marker.ADD):
    return [(marker.ns, marker.id) for marker in markers.markers if marker.action == action]


def drawn(tracks, params=ALL, times=2):
    """Last markers of a writer by namespace and ID, after several images of the same tracks."""
    writer = MarkerWriter(params)
    for image in range(times):
        message = writer.write(tracks, header_at(SECOND_NS + image * NS // 10, 'map'))
    return {(marker.ns, marker.id): marker for marker in message.markers if marker.action == Marker.ADD}


def xyz(marker):
    """Points (n, 3) of a marker in the frame of its header. They are relative to its pose, which is not rotated."""
    pose = marker.pose
    assert (pose.orientation.x, pose.orientation.y, pose.orientation.z, pose.orientation.w) == (0, 0, 0, 1)
    return (np.array([(point.x, point.y, point.z) for point in marker.points]).reshape(-1, 3)
            + (pose.position.x, pose.position.y, pose.position.z))


def rgb(color):
    return color.r, color.g, color.b


def test_markers_are_updated_while_the_track_exists_and_deleted_once():
    writer = MarkerWriter(ALL)
    messages = [writer.write(tracks, header_at(SECOND_NS + image * NS, 'map')) for image, tracks in enumerate(
        ([track(3), track(5)], [track(3), track(5)], [track(5)], [track(5, (0.0, 0.0, 0.0))], []))]
    both = sorted((namespace, number) for namespace in NAMESPACES for number in (3, 5))
    assert sorted(keys(messages[1])) == both and keys(messages[1], Marker.DELETE) == []
    assert all(marker.header == header_at(SECOND_NS + NS, 'map') and marker.lifetime.to_sec() == 2.0
               for marker in messages[1].markers)
    assert sorted(keys(messages[2], Marker.DELETE)) == sorted((namespace, 3) for namespace in NAMESPACES)
    assert keys(messages[3], Marker.DELETE) == [('prediction', 5), ('velocity', 5)]  # it stops
    assert len(keys(messages[4], Marker.DELETE)) == len(messages[4].markers)


@pytest.mark.parametrize('made, params, missing', [
    ({'steps': 0}, ALL, {'prediction'}), ({'variances': None}, ALL, {'ellipse'}),
    ({'velocity': (0.0, 0.0, 0.0)}, ALL, {'velocity', 'prediction'}),
    ({}, ALL._replace(marker_namespaces=['id', 'ellipse']), set(NAMESPACES) - {'id', 'ellipse'})])
def test_only_known_and_configured_parts_of_a_track_are_drawn(made, params, missing):
    assert set(name for name, _id in drawn([track(1, **made)], params)) == set(NAMESPACES) - missing


def test_arrows_end_where_the_object_is_after_one_and_two_seconds():
    markers = drawn([track(1, (0.5, -1.0, 0.0))])
    for namespace, end in (('velocity', (2.5, 0.0)), ('prediction', (3.0, -1.0))):
        start, tip = xyz(markers[namespace, 1])
        assert start.tolist() == [2.0, 1.0, 0.9] and tip[:2] == pytest.approx(end)


@pytest.mark.parametrize('turn, narrow_m2', [(0.4, 0.01), (2.0, 0.01), (0.0, 0.0)])
def test_the_ellipse_has_the_axes_and_the_direction_of_the_covariance(turn, narrow_m2):
    """The 95 % quantile of chi squared with 2 degrees of freedom is 5.991: axes of 2.448 standard deviations."""
    ellipse = drawn([track(1, variances=(0.04, narrow_m2), turn=turn)])['ellipse', 1]
    around = xyz(ellipse) - (2.0, 1.0, 0.05)
    assert ellipse.type == Marker.LINE_STRIP and ellipse.pose.orientation.w == 1.0
    assert around[0] == pytest.approx(around[-1]) and np.ptp(around[:, 2]) == 0  # closed, on the floor
    assert 0 < around[0, 2] < 0.05
    distances = np.linalg.norm(around[:, :2], axis=1)
    assert distances.max() == pytest.approx(0.2 * 2.448, rel=1e-3)
    assert distances.min() == pytest.approx(np.sqrt(narrow_m2) * 2.448, rel=1e-3, abs=1e-9)
    far = around[distances.argmax(), :2] / distances.max()
    assert abs(far.dot([np.cos(turn), np.sin(turn)])) == pytest.approx(1, abs=1e-6)


def test_the_history_is_the_path_and_fades_with_age():
    """A person walks along x at 1 m/s for 10 s."""
    writer = MarkerWriter(MarkerParams(marker_history=4.0))
    for image in range(101):
        header = header_at(SECOND_NS + image * NS // 10, 'map')
        message = writer.write([track(1, position=(image / 10, 0.0, 0.85))], header)
    history = {marker.ns: marker for marker in message.markers if marker.action == Marker.ADD}['history']
    points, alphas = xyz(history), np.array([color.a for color in history.colors])
    assert history.type == Marker.LINE_STRIP and history.color.a < 1  # otherwise RViz draws it opaque
    assert (points[0, 0], points[-1, 0]) == pytest.approx((6.0, 10.0)) and points[:, 1:] == pytest.approx(
        np.tile([0.0, 0.02], (len(points), 1)))
    assert len(alphas) == len(points) and (np.diff(alphas) > 0).all()
    assert alphas[0] < 0.1 and alphas[-1] > 0.8
    assert set(rgb(color) for color in history.colors) == {PALETTE[0]}


@pytest.mark.parametrize('coloring', ['id', 'status', 'thesis'])
def test_tracks_that_are_not_visible_are_paler_and_have_a_question_mark(coloring):
    params = ALL._replace(marker_color=coloring)
    seen, unseen = drawn([track(3)], params), drawn([track(3, status=OCCLUDED)], params)
    assert (seen['id', 3].text, unseen['id', 3].text) == ('3', '3?')
    assert rgb(seen['id', 3].color) != rgb(unseen['id', 3].color)
    assert drawn([track(3)._replace(label='dog')], params)['id', 3].text == 'dog 3'
    for namespace in ('cylinder', 'velocity', 'prediction'):
        assert 0.1 < unseen[namespace, 3].color.a < seen[namespace, 3].color.a / 2
