"""Tracks as planners read them: each message is serialized."""
import sys
from unittest import mock

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from nav_msgs.msg import OccupancyGrid
from sensor_msgs.msg import PointCloud2

from ros_3d_bb.camera.camera_model import transform_from, transform_points
from ros_3d_bb.conversions import planner_msgs
from ros_3d_bb.conversions.perception_msgs import time_from
from ros_3d_bb.conversions.planner_msgs import detections3d_to_msg, objects_to_msg, obstacles_to_msg, people_to_msg
from ros_3d_bb.core.params import params_from
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.nodes.planner_bridge_node import PlannerBridgeParams
from ros_3d_bb.planning.planner_outputs import OPTIONAL, Output, outputs_from
from ros_3d_bb.planning.planner_view import footprint_points, in_frame, predicted_to
from ros_3d_bb.tracking.types import OCCLUDED, VISIBLE
from support.code_blocks import blocks_in
from support.masterless import on_the_wire
from support.planner_definitions import PUBLISHED_MD5, message_class, package
from support.ros import header_at
from support.tracks import track_at

QUARTER = transform_from((10, 5, 0), (0, 0, np.sqrt(0.5), np.sqrt(0.5)))  # odom_from_map: a quarter turn to the left
STAMP_NS = 1000 * NS


def walker(number, position_m, velocity_mps, status=VISIBLE, width_m=0.6, label='person', score=0.0):
    track = track_at(position_m, velocity_mps, moving=any(velocity_mps), number=number,
                     covariance=np.diag([0.01, 0.04, 0.09, 0.1, 0.2, 0.3]))
    return track._replace(size_m=np.array([width_m, width_m, 1.7]), status=status, label=label, score=score)


@pytest.mark.parametrize('kind', sorted(PUBLISHED_MD5))
def test_the_definitions_used_here_are_the_published_ones(kind):
    assert message_class(kind)._md5sum == PUBLISHED_MD5[kind]


def sent(write, package_name, tracks, frame_id='map'):
    return on_the_wire(write(tracks, header_at(STAMP_NS, frame_id), package(package_name)))


def obstacles(tracks, frame_id='map'):
    return sent(obstacles_to_msg, 'costmap_converter', tracks, frame_id).obstacles


def test_obstacles_are_circles_where_people_are_now():
    """TEB takes positions as of now, and transforms them into its frame, but not velocities. The image is 0.3 s old."""
    tracks = predicted_to([walker(3, [1, 2, 0.9], [1.2, 0, 0]), walker(4, [5, 5, 0.9], [0, 0, 0])], 0.3)
    walking, standing = obstacles(in_frame(tracks, QUARTER), 'odom')
    for obstacle, position_m, velocity_mps in ((walking, [8, 6.36], [0, 1.2]), (standing, [5, 10], [0, 0])):
        (point,), twist = obstacle.polygon.points, obstacle.velocities.twist  # one point: a circle to TEB
        np.testing.assert_allclose([point.x, point.y], position_m, atol=1e-6)
        np.testing.assert_allclose([twist.linear.x, twist.linear.y], velocity_mps, atol=1e-9)
        assert obstacle.radius == pytest.approx(0.3)
    assert walking.id == 3 and walking.header.frame_id == 'odom' and walking.orientation.w == 1
    covariance = np.reshape(walking.velocities.covariance, (6, 6))
    assert np.trace(covariance) == pytest.approx(0.6) and covariance[2, 2] == pytest.approx(0.3)


def test_mpc_planner_jackal_receives_everyone_with_radius_and_velocity():
    """It skips ID 0, takes the second dimension as the radius, and turns the twist by minus the yaw of the pose
    (tud-amr/mpc_planner, ros1_jackal.cpp, obstacleCallback)."""
    walking, standing = sent(objects_to_msg, 'derived_object_msgs', [
        walker(1, [1, 2, 0.9], [0.3, -1.1, 0]), walker(2, [4, 2, 0.9], [0, 0, 0], width_m=0.4)]).objects
    assert (walking.id, standing.id, walking.pose.orientation.w) == (1, 2, 1)
    assert walking.shape.type == standing.shape.type == walking.shape.CYLINDER
    assert (walking.pose.position.x, walking.pose.position.y) == (1, 2)
    assert (walking.twist.linear.x, walking.twist.linear.y) == (0.3, -1.1)
    assert (walking.detection_level, walking.classification, walking.object_classified) == (1, 4, True)  # pedestrian
    assert walking.shape.dimensions == pytest.approx((1.7, 0.3)) and standing.shape.dimensions[1] == pytest.approx(0.2)
    assert walking.header.stamp == time_from(STAMP_NS)


@pytest.mark.parametrize('status, tag, reliability', [(VISIBLE, 'visible', 1.0), (OCCLUDED, 'occluded', 0.5),
                                                      (7, 'unknown', 0.5)])
def test_people_have_an_id_tags_and_reliability(status, tag, reliability):
    person, = sent(people_to_msg, 'people_msgs', [walker(12, [1, 2, 0.9], [0, 0, 0], status, score=0.75)]).people
    assert (person.name, person.reliability) == ('12', reliability)
    assert dict(zip(person.tagnames, person.tags)) == {'label': 'person', 'score': '0.75', 'status': tag,
                                                       'width': '0.60', 'height': '1.70'}


@pytest.mark.parametrize('label, score, name, certainty', [
    ('person', 0.0, 'PEDESTRIAN', 255), ('bicycle', 0.5, 'BIKE', 128), ('chair', 0.8, 'UNKNOWN', 204)])
def test_objects_are_classified(label, score, name, certainty):
    tracks = [walker(1, [1, 2, 0.9], [0, 0, 0], label=label, score=score)]
    item, = sent(objects_to_msg, 'derived_object_msgs', tracks).objects
    assert item.classification == getattr(item, 'CLASSIFICATION_' + name) and item.classification_certainty == certainty
    assert item.object_classified == (name != 'UNKNOWN')


def test_detections_have_box_id_and_covariance():
    message = sent(detections3d_to_msg, 'vision_msgs', [
        walker(3, [1, 2, 0.9], [1, 0, 0]), walker(4, [1, 2, 0.9], [1, 0, 0], OCCLUDED, label='dog', score=0.8)])
    detection, dog = message.detections
    assert [(result.id, result.score) for result in dog.results] == [(4, 0.4), (16, 0.4)]  # the ID, the class
    assert message.header.frame_id == detection.header.frame_id == 'map'
    box, result = detection.bbox, detection.results[0]
    assert (box.center.position.x, box.center.position.y, box.center.position.z) == (1, 2, 0.9)
    assert (box.size.x, box.size.y, box.size.z) == (0.6, 0.6, 1.7) and box.center.orientation.w == 1
    assert (result.id, result.score) == (3, 1.0) and result.pose.pose == box.center
    np.testing.assert_allclose(np.diag(np.reshape(result.pose.covariance, (6, 6)))[:3], [0.01, 0.04, 0.09])


def tilted(roll_deg, pitch_deg, height_m):
    """odom_from_base_link of a robot that is tilted or drives on a slope."""
    roll, pitch = np.radians([roll_deg, pitch_deg]) / 2
    return (transform_from((1, 0, height_m), (0, 0, 0.6, 0.8))
            .dot(transform_from((0, 0, 0), (0, np.sin(pitch), 0, np.cos(pitch))))
            .dot(transform_from((0, 0, 0), (np.sin(roll), 0, 0, np.cos(roll)))))


@given(st.floats(-1e6, 1e6), st.floats(-1e6, 1e6), st.floats(-np.pi, np.pi), st.floats(-25, 25), st.floats(-25, 25))
@settings(deadline=None, max_examples=30)
def test_costmap_points_are_exact_on_large_maps(x, y, yaw, roll_deg, pitch_deg):
    """Against float64: each point is within 0.01 mm of the cylinder's points, seen from the map."""
    map_from_robot = transform_from((x, y, 0.2), (0, 0, np.sin(yaw / 2), np.cos(yaw / 2))).dot(
        tilted(roll_deg, pitch_deg, 0))
    track = walker(1, map_from_robot[:3, 3] + [3, -2, 0.65], [1, 0.5, 0])
    points, = [output for output in outputs_from(PlannerBridgeParams()) if output.topic == '~points']
    message = on_the_wire(points.write([track], np.linalg.inv(map_from_robot), header_at(STAMP_NS, points.frame)))
    sent = np.frombuffer(message.data, '<f4').reshape(-1, 3).astype(float)
    in_map = transform_points(map_from_robot, sent) - track.position_m
    np.testing.assert_allclose(in_map, footprint_points([track], 0.3, 0.035) - track.position_m, rtol=0, atol=1e-5)
    assert message.header.frame_id == 'base_link'


@pytest.mark.parametrize('name, lacking', [('people', 'people_msgs'), ('teb', 'costmap_converter')])
def test_a_missing_package_is_named_with_what_to_install(monkeypatch, name, lacking):
    monkeypatch.setitem(sys.modules, lacking + '.msg', None)
    with pytest.raises(ValueError, match='needs the package %s .*ros-noetic-%s' % (lacking, lacking.replace('_', '-'))):
        outputs_from(PlannerBridgeParams(outputs=['costmap', name]))


@pytest.mark.parametrize('outputs, said', [(['tebb'], "'tebb'; did you mean teb"), ([], 'outputs is empty')])
def test_unknown_outputs_are_rejected_with_the_nearest_known_one(outputs, said):
    with pytest.raises(ValueError, match=said):
        outputs_from(*params_from({'outputs': outputs}, PlannerBridgeParams))


def test_the_costmap_needs_no_package_and_no_ring_where_its_range_is_zero():
    assert [(output.topic, output.kind) for output in outputs_from(PlannerBridgeParams())] == [
        ('~points', PointCloud2), ('~costs', OccupancyGrid), ('~clearing_points', PointCloud2)]
    assert [output.topic for output in outputs_from(PlannerBridgeParams(clearing_range=0.0))] == ['~points', '~costs']


def test_the_example_of_an_output_converts_tracks():
    """In CONTRIBUTING.md: a function in `planner_msgs`, and a row of OPTIONAL."""
    blocks = [block.text for block in blocks_in('CONTRIBUTING.md') if 'poses_to_msg' in block.text]
    names = dict(vars(planner_msgs), Output=Output)
    exec(blocks[0], names)
    exec('rows = {%s}' % blocks[1], names)
    with mock.patch.dict(OPTIONAL, names['rows']):
        output, = outputs_from(PlannerBridgeParams(outputs=['poses']))
    message = on_the_wire(output.write([walker(1, (2.0, 3.0, 0.9), (0, 0, 0))], np.eye(4), header_at(1, 'map')))
    assert isinstance(message, output.kind) and message.header.frame_id == 'map'
    assert [(pose.position.x, pose.position.y, pose.position.z) for pose in message.poses] == [(2.0, 3.0, 0.9)]
