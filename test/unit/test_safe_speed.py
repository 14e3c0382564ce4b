import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from ros_3d_bb.estimation.error_model import UNCALIBRATED_SIGMA_M
from ros_3d_bb.planning.planner_view import position_after
from ros_3d_bb.planning.safe_speed import (LEAST_WIDTH_M, CornerParams, SafeSpeedParams, blind_corners,
                                           highest_safe_speed, limited_velocity, speed_before_corners)
from ros_3d_bb.tracking.tracker import Tracker
from ros_3d_bb_lab.simulation.laser import BEAMS, FIELD_OF_VIEW, RANGE_M, scan_ranges
from ros_3d_bb_lab.simulation.scenario import scenario_from
from support.people import at, mounted, play
from support.tracks import track_at

PARAMS = SafeSpeedParams(position_sigmas=0.0)
RADIUS_M = 0.25 + PARAMS.robot_radius + PARAMS.people_clearance
HERE = np.eye(4)


def speed_among(*tracks, velocity=(1.0, 0.0, 0.0), params=PARAMS, age_s=0.0, robot_from_tracks=HERE):
    return highest_safe_speed(tracks, age_s, robot_from_tracks, velocity, params)


def stopping_distance(speed_mps):
    return speed_mps * PARAMS.reaction_time + speed_mps ** 2 / (2 * PARAMS.deceleration)


def place_after(speed_mps, elapsed_s):
    """Distance (n,) that the robot has moved along x when it brakes from a speed."""
    braking_s = np.clip(elapsed_s - PARAMS.reaction_time, 0, speed_mps / PARAMS.deceleration)
    return speed_mps * np.minimum(elapsed_s, PARAMS.reaction_time) + (
        speed_mps * braking_s - PARAMS.deceleration * braking_s ** 2 / 2)


def nearest_m(speed_mps, track, times_s):
    """Smallest distance of the centre of the robot, until it stands, from that of a person."""
    robot_m = np.column_stack((place_after(speed_mps, times_s), np.zeros((len(times_s), 2))))
    return np.linalg.norm((position_after(track, times_s) - robot_m)[:, :2], axis=1).min()


@pytest.mark.parametrize('distance_m', [1.0, 1.5, 2.0, 2.6])
def test_the_robot_stops_before_a_standing_person(distance_m):
    speed_mps = speed_among(track_at([distance_m, 0.2, 0.9], [0, 0, 0], moving=False))
    free_m = distance_m - np.sqrt(RADIUS_M ** 2 - 0.2 ** 2)
    assert free_m - 0.11 <= stopping_distance(speed_mps) <= free_m


@settings(deadline=None, max_examples=100)
@given(st.floats(0.8, 6), st.floats(-3, 3), st.floats(-2, 2), st.floats(-2, 2))
def test_at_a_safe_speed_the_robot_touches_nobody_who_walks_as_predicted(x, y, vx, vy):
    track = track_at([x, y, 0.9], [vx, vy, 0])
    speed_mps = speed_among(track)
    times_s = np.arange(0, PARAMS.reaction_time + speed_mps / PARAMS.deceleration, 0.01)
    if nearest_m(0, track, times_s) > RADIUS_M:  # people may walk into a robot that stands
        assert nearest_m(speed_mps, track, times_s) > RADIUS_M - PARAMS.people_clearance


def test_people_beside_and_behind_the_way_do_not_count():
    assert speed_among(track_at([-1.5, 0, 0.9], [0, 0, 0]), track_at([1.5, 1.0, 0.9], [0, 0, 0])) == 2.0
    assert speed_among(track_at([-1.5, 0, 0.9], [0, 0, 0]), velocity=(-0.5, 0.0, 0.0)) < 1.2
    assert speed_among(track_at([1.5, 1.0, 0.9], [0, 0, 0]), velocity=(0.5, 0.0, 0.4)) < 1.3


def test_a_person_who_will_cross_counts_only_if_the_robot_moves_then():
    assert speed_among(track_at([0.9, 2.2, 0.9], [0, -1.0, 0])) < 1.4
    assert speed_among(track_at([0.9, 4.2, 0.9], [0, -1.0, 0])) == 2.0


def test_a_robot_at_a_person_may_only_leave():
    near = track_at([0.5, 0.1, 0.9], [0, 0, 0], moving=False)
    assert speed_among(near) == 0.0
    assert speed_among(near, velocity=(-0.5, 0.0, 0.0)) == 2.0


@pytest.mark.parametrize('ahead_m, limit_mps', [(3.0, 1.4), (2.0, 0.9), (1.0, 0.3), (0.7, 0.0), (0.65, 0.0)])
def test_the_limits_before_a_standing_person_are_those_of_the_page(ahead_m, limit_mps):
    """doc/planners.md. Nearer than the clearance, the robot may not approach, however uncertain the position is."""
    person, = play(Tracker(), 2, lambda _time_s: [at(ahead_m, 0.0, sigma=UNCALIBRATED_SIGMA_M)])[-1]
    assert speed_among(person, params=SafeSpeedParams()) == pytest.approx(limit_mps, abs=0.05)


@pytest.mark.parametrize('y, turn, least, most', [(0.5, -0.3, 0.3, 0.3), (0.0, 0.0, 0.0, 0.2)])
def test_a_robot_slowly_leaves_the_way_of_a_person_who_comes_towards_it(y, turn, least, most):
    """It would be touched where it stops. Straight towards the person, it stops before the body."""
    assert least <= speed_among(track_at([1.2, y, 0.9], [-1.1, 0, 0]), velocity=(0.6, 0.0, turn)) <= most


@pytest.mark.parametrize('tilt_deg', [{'pitch_deg': 5}, {'pitch_deg': -5}, {'roll_deg': 5}])
def test_a_robot_on_a_slope_300_m_above_the_origin_is_as_fast_as_on_the_level(tilt_deg):
    def speed(**angles_deg):
        map_from_robot = mounted(300.0, yaw_deg=30, **angles_deg).dot(np.linalg.inv(mounted(0.0)))
        standing = track_at([1.5, 0.9, 300.9], [0, 0, 0], moving=False)
        return speed_among(standing, robot_from_tracks=np.linalg.inv(map_from_robot))
    assert speed(**tilt_deg) == pytest.approx(speed(), abs=0.05) and speed() < 1.3


def test_limited_velocities_stay_on_their_path():
    assert limited_velocity((1.0, 0.0, 0.5), 0.4) == pytest.approx((0.4, 0, 0.2))
    assert limited_velocity((-0.6, 0.8, 0.5), 0.5) == pytest.approx((-0.3, 0.4, 0.25))
    assert limited_velocity((0.3, 0.0, 0.5), 0.4) == (0.3, 0.0, 0.5)
    assert limited_velocity((0.5, 0.0, 0.5), 0.0) == (0.0, 0.0, 0.0)
    assert limited_velocity((0.0, 0.0, 0.5), 0.0) == (0.0, 0.0, 0.5)  # the robot is round


SAFETY, CORNERS = SafeSpeedParams(), CornerParams()
STEP, AHEAD = FIELD_OF_VIEW / (BEAMS - 1), (1.0, 0.0, 0.0)
PILLAR = {'at': [4.0, 1.2], 'size': [0.7, 0.7, 2.2]}


def corners_from(x, furniture=(PILLAR,), people_m=()):
    """Corners (n, 2) in the map that a laser at (x, 0) sees, which looks along x."""
    room = scenario_from({'duration': 1, 'people': [], 'room': {
        'bounds': [-4, 13, -4, 4], 'height': 2.8, 'furniture': list(furniture)}}).room
    ranges_m = scan_ranges((x, 0.0, 0.0), room, people_m, [0.15] * len(people_m))
    corners_m = blind_corners(ranges_m, (0.1, RANGE_M), -FIELD_OF_VIEW / 2, STEP)
    assert corners_m.shape[1] == 3 and not corners_m[:, 2].any()
    return corners_m[:, :2] + [x, 0.0]


@pytest.mark.parametrize('x', [1.0, 2.0, 3.0])
def test_a_pillar_has_a_corner_on_each_side_of_its_shadow(x):
    beside, behind = sorted(corners_from(x).tolist(), key=lambda corner: corner[1])
    assert beside == pytest.approx([4.3, 0.85], abs=0.06) and behind == pytest.approx([3.65, 1.5], abs=0.06)


def test_walls_legs_and_narrow_poles_hide_no_people():
    assert not len(corners_from(0.0, furniture=()))
    assert not len(corners_from(0.0, furniture=[dict(PILLAR, size=[LEAST_WIDTH_M - 0.05] * 2 + [2.2])]))
    assert not len(corners_from(0.0, furniture=(), people_m=[(2.0, 0.5), (1.0, -1.0)]))


def corners_of_a_wall(ranges_m, least_m=0.1, largest_m=10.0):
    """Corners (n, 3) that a laser sees beside a wall on its left, y = 1 m, which ends before the beam at 21 degrees.
    Where the wall is not, ranges (or one for all) are as given. The laser looks from -90 to 90 degrees."""
    angles = np.radians(np.arange(-90, 91))
    with np.errstate(divide='ignore'):
        walls_m = np.where(angles > np.radians(20.5), 1 / np.sin(angles), ranges_m)
    return blind_corners(walls_m, (least_m, largest_m), angles[0], np.radians(1))


@pytest.mark.parametrize('ranges_m, least_m, largest_m', [
    (np.inf, 0.1, 10.0), (np.inf, 0.1, np.inf), (11.0, 0.1, 10.0), (np.inf, 0.0, 0.0), (5.0, 0.1, 0.0),
    (0.0, 0.1, 10.0), (0.0, 0.0, 0.0), (np.nan, 0.1, 10.0), (-np.inf, 0.1, np.inf)])
def test_what_is_not_measured_is_no_free_space(ranges_m, least_m, largest_m):
    """Some drivers report 0 or nan where nothing is in range, and leave out the limits."""
    (x, y, _z), = corners_of_a_wall(ranges_m, least_m, largest_m)
    assert (x, y) == pytest.approx((1 / np.tan(np.radians(21)), 1.0))


@pytest.mark.parametrize('first_deg, step_deg, value', [(0, 1, np.nan), (0, 1, 0.0), (np.nan, 1, 2.0), (0, 0, 2.0)])
def test_a_scan_without_information_is_rejected(first_deg, step_deg, value):
    with pytest.raises(ValueError, match='none of its 9 beams'):
        blind_corners(np.full(9, value), (0.1, 10.0), np.radians(first_deg), np.radians(step_deg))


@pytest.mark.parametrize('beams, corners', [(9, 0), (11, 2)])
def test_a_gap_in_an_obstacle_is_an_opening_if_a_person_fits_into_it(beams, corners):
    """Across the ends of a full circle, at 2 m: 10 degrees are 0.35 m."""
    ranges_m = np.full(360, 2.0)
    ranges_m[:beams // 2] = ranges_m[beams // 2 - beams:] = np.nan
    assert len(blind_corners(ranges_m, (0.1, 10.0), 0.0, np.radians(1))) == corners


@pytest.mark.parametrize('first_deg', [-180, -8, 0, 5, 9])
@pytest.mark.parametrize('step_deg', [1, -1])
def test_an_obstacle_across_the_ends_of_a_full_circle_has_two_corners(first_deg, step_deg):
    """As straight ahead of a robot whose laser is mounted backwards."""
    angles = np.radians(first_deg + step_deg * np.arange(360))
    ranges_m = np.where(np.cos(angles) >= np.cos(np.radians(8.5)), 2.0, 6.0)
    corners_m = blind_corners(ranges_m, (0.1, RANGE_M), angles[0], np.radians(step_deg))
    corner_m = 2.0 * np.cos(np.radians(8)), 2.0 * np.sin(np.radians(8))
    np.testing.assert_allclose(sorted(corners_m[:, 1]), [-corner_m[1], corner_m[1]])
    np.testing.assert_allclose(corners_m[:, 0], corner_m[0])


def speed_at(x, corners_m, params=CORNERS):
    return speed_before_corners(np.reshape(corners_m, (-1, 2)) - [x, 0.0], 0.0, AHEAD, SAFETY, params)


def test_the_robot_slows_down_until_it_has_passed_the_corner():
    speeds_mps = [speed_at(x, [4.35, 0.85]) for x in np.arange(0, 4.3, 0.2)]
    assert speeds_mps == sorted(speeds_mps, reverse=True)
    assert speeds_mps[0] > 1.2 and speeds_mps[-1] == CORNERS.corner_speed
    assert speed_at(4.4, [4.35, 0.85]) == SAFETY.highest_speed
    assert speed_at(3.0, [4.35, 5.0]) == SAFETY.highest_speed > speed_at(3.0, [4.35, -0.85])


def stopped_before(speed_mps, corner_m, people_mps):
    """Whether a robot that brakes from a speed stands before anyone from the corner can touch it."""
    times_s = np.arange(0, SAFETY.reaction_time + speed_mps / SAFETY.deceleration, 0.01)
    robot_m = np.column_stack((place_after(speed_mps, times_s), 0 * times_s))
    return (np.linalg.norm(robot_m - corner_m, axis=1) - people_mps * times_s > SAFETY.robot_radius).all()


@settings(deadline=None, max_examples=100)
@given(st.floats(0.5, 5), st.floats(-3, 3), st.floats(0.2, 2.5))
def test_the_robot_stops_before_people_from_the_corner(x, y, people_mps):
    speed_mps = speed_at(0.0, [x, y], CornerParams(emerging_speed=people_mps))
    if speed_mps > CORNERS.corner_speed:
        assert stopped_before(speed_mps, [x, y], people_mps)


def test_an_older_scan_allows_less_speed():
    older, newer = (speed_before_corners([[2.0, 1.2]], age_s, AHEAD, SAFETY, CORNERS) for age_s in (0.3, 0.0))
    assert CORNERS.corner_speed < older < newer
