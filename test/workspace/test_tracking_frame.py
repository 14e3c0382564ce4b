"""People are tracked in odom and published in map, whose corrections tf2 interpolates."""
import json

import genpy
import numpy as np
import pytest
from nav_msgs.msg import OccupancyGrid

from ros_3d_bb.camera.camera_model import transform_from, transform_points
from ros_3d_bb.conversions.camera_msgs import transform_messages
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.pipeline.tracking_stage import TRACKING_PARAMS, TrackerNodeParams
from ros_3d_bb.pipeline.transform_buffer import TransformBuffer
from support.people import mounted
from support.two_cameras import START_NS, Rig, boxes

PEOPLE = np.array([(4.0, 0.3, 0.85), (5.0, -1.0, 0.85)])  # in odom
CORRECTION_S = 4.0
SQUARE = np.array([(3.6, -0.2), (4.4, -0.2), (4.4, 0.8), (3.6, 0.8)])  # around the first person in odom


def planar(x, y, yaw):
    return transform_from((x, y, 0), (0, 0, np.sin(yaw / 2), np.cos(yaw / 2)))


class Robot(object):
    """A robot whose localisation is corrected at `CORRECTION_S`. The frames of its tf may have a prefix."""

    def __init__(self, correction, prefix='', tf_hz=10, speed_mps=0.3, **params):
        self.correction, self.prefix, self._tf_hz, self._speed_mps = correction, prefix, tf_hz, speed_mps
        self.transforms, self._random, self._last_s = TransformBuffer(), np.random.RandomState(0), {}
        self._set([(prefix + 'base_link', prefix + 'camera', mounted(1.0))], 0, is_static=True)
        self.rig = Rig(transforms=self.transforms, **params)

    def _set(self, links, time_s, is_static=False):
        add = self.transforms.set_transform_static if is_static else self.transforms.set_transform
        for message in transform_messages(genpy.Time.from_sec(START_NS / NS + time_s), links):
            add(message, 'test')

    def _publish(self, parent, child, rate_hz, pose_at, until_s):
        while self._last_s.get(child, -1.0) < until_s + 0.2:
            self._last_s[child] = self._last_s.get(child, -1.0) + 1.0 / rate_hz
            self._set([(parent, child, pose_at(self._last_s[child]))], self._last_s[child])

    def odom_from_base(self, time_s):
        return planar(self._speed_mps * time_s, 0, 0.1 * np.sin(time_s))

    def map_from_odom(self, time_s):
        return planar(*self.correction) if time_s >= CORRECTION_S else np.eye(4)

    def tracks_until(self, end_s, start_s=0.0, rate_hz=30):
        """The published tracks of each image, [(time, tracks)]."""
        found = []
        for time_s in np.arange(start_s, end_s, 1 / rate_hz):
            self._publish('map', self.prefix + 'odom', self._tf_hz, self.map_from_odom, time_s)
            self._publish(self.prefix + 'odom', self.prefix + 'base_link', 50, self.odom_from_base, time_s)
            odom_from_camera = self.odom_from_base(time_s).dot(mounted(1.0))
            places_m = PEOPLE + self._random.normal(0, 0.02, PEOPLE.shape)
            seen_m = transform_points(np.linalg.inv(odom_from_camera), places_m)
            stamp_ns = START_NS + int(round(time_s * NS))
            result = self.rig.send_boxes(boxes(stamp_ns, self.prefix + 'camera', seen_m.tolist()))
            found.append((time_s, result.tracks))
        return found


@pytest.mark.parametrize('correction', [(0.3, 0.0, 0.0), (0.0, -0.8, 0.0), (0.2, 0.2, 0.15)])
@pytest.mark.parametrize('tf_hz', [5, 10, 30])
def test_a_correction_of_the_localisation_gives_standing_people_no_velocity(correction, tf_hz):
    """tf2 interpolates the correction over several images. The positions follow it at once."""
    robot = Robot(correction, tf_hz=tf_hz)
    after = [(time_s, tracks) for time_s, tracks in robot.tracks_until(7.0) if time_s > 3.5]
    for time_s, tracks in after:
        assert [track.id for track in tracks] == [1, 2] and not any(track.moving for track in tracks)
        assert max(np.linalg.norm(track.velocity_mps) for track in tracks) <= 0.12
        if not CORRECTION_S - 1 / tf_hz < time_s < CORRECTION_S + 1 / tf_hz:
            expected_m = transform_points(robot.map_from_odom(time_s), PEOPLE)
            np.testing.assert_allclose([track.position_m for track in tracks], expected_m, atol=0.08)
            for track, place_m in zip(tracks, expected_m):
                np.testing.assert_allclose(track.prediction_m, np.tile(place_m, (8, 1)), atol=0.3)


@pytest.mark.parametrize('prefix', ['', 'robot1/', 'robot1_'])
def test_names_of_odometry_frames_may_have_a_prefix(prefix):
    speeds_mps = [np.linalg.norm(track.velocity_mps) for time_s, tracks in Robot((0.5, 0, 0), prefix).tracks_until(5.0)
                  for track in tracks if time_s > 3.5]
    assert max(speeds_mps) < 0.12


def test_people_can_be_tracked_in_the_target_frame():
    """A correction is then a motion of the people."""
    published = Robot((0.5, 0, 0), tracking_frame='map').tracks_until(5.0)
    assert max(np.linalg.norm(track.velocity_mps) for _time_s, tracks in published for track in tracks) > 0.3


def test_covariances_and_velocities_are_those_of_the_target_frame():
    """map is turned by 90 degrees: what is along x in odom is along y in map."""
    robot = Robot((0.0, 0.0, np.pi / 2))
    (_before_s, before), = robot.tracks_until(2.0)[-1:]
    (_after_s, after), = robot.tracks_until(6.0, 2.0)[-1:]
    for first, later in zip(before, after):
        np.testing.assert_allclose(np.linalg.eigvalsh(first.covariance[:2, :2]),
                                   np.linalg.eigvalsh(later.covariance[:2, :2]), rtol=0.5)
        assert (first.covariance[0, 0] > first.covariance[1, 1]) == (later.covariance[1, 1] > later.covariance[0, 0])
        last_m2 = later.prediction_covariance_m2[-1]
        assert last_m2[1, 1] != last_m2[0, 0]


@pytest.mark.parametrize('use_map', [False, True])
def test_areas_and_maps_are_in_the_target_frame(use_map):
    """The localisation is corrected before they are set; the first person is inside, and the track ends."""
    robot = Robot((1.0, -0.5, 0.3), speed_mps=0.0)
    assert [track.id for track in robot.tracks_until(6.0)[-1][1]] == [1, 2]
    corners_m = transform_points(robot.map_from_odom(6.0), np.column_stack((SQUARE, np.zeros(4))))[:, :2]
    if use_map:
        grid = OccupancyGrid(data=[100] * 64)
        grid.header.frame_id, grid.info.resolution = 'map', 0.1
        grid.info.width, grid.info.height = 8, 8
        grid.info.origin.position.x, grid.info.origin.position.y = corners_m[0]
        grid.info.origin.orientation.z, grid.info.origin.orientation.w = np.sin(0.15), np.cos(0.15)
        robot.rig.set_map(grid)
    else:
        params = TrackerNodeParams(ignored_areas=json.dumps([corners_m.tolist()]))
        robot.rig.reconfigure(params, [kind() for kind in TRACKING_PARAMS])
    for _time_s, tracks in robot.tracks_until(8.0, 6.0):
        assert [track.id for track in tracks] == [2]
    assert robot.rig.events.counts['boxes in ignored areas'] >= 50
