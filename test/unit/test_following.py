import numpy as np
import pytest

from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.planning.following import Follower, FollowParams, TargetSelector
from ros_3d_bb.planning.safe_speed import SafeSpeedParams
from ros_3d_bb.tracking.types import OCCLUDED, OUT_OF_VIEW, VISIBLE
from ros_3d_bb_lab.simulation.driven_world import moved
from ros_3d_bb_lab.simulation.simulator import upright
from support.tracks import track_at

PARAMS, SAFETY = FollowParams(), SafeSpeedParams()
ORIGIN, STEP_S = np.zeros(2), 0.05


def person(number, x, y, status=VISIBLE, vx=0.0, vy=0.0, first_s=0.0):
    track = track_at([x, y, 0.9], [vx, vy, 0], moving=bool(vx or vy), number=number)
    return track._replace(status=status, first_seen_ns=int(first_s * NS))


def selected(selector, seconds, *tracks, **params):
    track = selector.select(tracks, int(seconds * NS), ORIGIN, PARAMS._replace(**params))
    return None if track is None else track.id


def test_the_nearest_visible_person_is_chosen_and_kept():
    selector = TargetSelector()
    dog = person(4, 0.5, 0)._replace(label='dog')
    assert selected(selector, 1, person(1, 3, 0), person(2, 2, 0, OCCLUDED), person(3, 2.5, 0), dog) == 3
    assert selected(selector, 2, person(1, 1, 0), person(3, 4, 0)) == 3


def test_a_given_track_is_awaited():
    selector = TargetSelector()
    assert selected(selector, 1, person(1, 3, 0), track_id=2) is None
    assert selected(selector, 2, person(1, 3, 0), person(2, 4, 0, OUT_OF_VIEW), track_id=2) is None
    assert selected(selector, 3, person(1, 3, 0), person(2, 4, 0), track_id=2) == 2


def test_a_hidden_person_is_lost_after_a_second_and_found_by_the_same_id():
    selector = TargetSelector()
    selected(selector, 1, person(1, 3, 0))
    assert selected(selector, 1.9, person(1, 3, 0, OCCLUDED), person(2, 2, 0)) == 1
    assert selected(selector, 2.1, person(1, 3, 0, OCCLUDED), person(2, 2, 0)) is None
    assert selected(selector, 3.0, person(1, 3, 0), person(2, 2, 0)) == 1


def test_a_person_from_before_a_jump_of_the_clock_is_not_followed():
    selector = TargetSelector()
    selected(selector, 100, person(1, 3, 0))
    assert selected(selector, 40, person(2, 3, 0, first_s=39)) is None and selector.has_given_up
    assert selected(selector, 101, person(3, 3, 0, first_s=100.5)) is None


@pytest.mark.parametrize('others, followed', [
    ([person(2, 4, 0, first_s=3)], 2),  # where the person is expected
    ([person(2, 4, 0, first_s=3), person(3, 4, 1.5, first_s=2)], 2),  # clearly nearer
    ([person(2, 4.4, 0, first_s=3), person(3, 4, 0.6, first_s=2)], None),  # either can be the person
    ([person(2, 4, 0, first_s=0.5)], None),  # known before
    ([person(2, 12, 0, first_s=3)], None),  # too far away
    ([person(2, 4, 0, OCCLUDED, first_s=3)], None),
    ([person(2, 4, 0, first_s=3)._replace(label='dog')], None)])
def test_a_new_track_is_the_lost_person_if_it_is_clearly_the_nearest(others, followed):
    selector = TargetSelector()
    selected(selector, 1, person(1, 2, 0, vx=1.0))
    assert selected(selector, 3.2, *others) == followed
    assert selected(selector, 3.4, *others) == followed


def test_a_person_is_recognised_at_once_while_the_old_track_is_occluded():
    """A person who crosses can drag the track along."""
    selector = TargetSelector()
    selected(selector, 1, person(1, 3, 0), person(2, 3, 1))
    assert selected(selector, 1.5, person(1, 2.8, -0.4, OCCLUDED), person(2, 2.5, -0.5),
                    person(3, 3.1, 0, first_s=1.2)) == 3


@pytest.mark.parametrize('published, followed', [(True, 1), (False, 3)])
def test_someone_near_is_not_taken_for_a_person_who_is_still_tracked(published, followed):
    """Someone steps between the robot and the person, and hides the person."""
    selector = TargetSelector()
    selected(selector, 1, person(1, 3, 0))
    hidden = [person(1, 3, 0, OCCLUDED)] if published else []
    assert selected(selector, 1.8, person(3, 2, 0, first_s=1.6), *hidden) == followed


@pytest.mark.parametrize('turn_mps, missed_s, followed', [(1.0, 0.0, 3), (1.0, 2.3, 3), (0.1, 0.0, 1)])
def test_an_id_switch_to_a_person_who_crosses_is_noticed(turn_mps, missed_s, followed):
    """Track 1 of a person who walks along x goes on across it, and a new one begins where the person is. The detector
    may miss the person once."""
    selector = TargetSelector()
    for time_s in np.arange(1, 2.01, 0.1):
        selected(selector, time_s, person(1, 2 + 0.7 * time_s, 0, vx=0.7))
    for time_s in np.arange(2.1, 3.01, 0.1):
        own = person(1, 2 + 0.7 * time_s, -turn_mps * (time_s - 2), vx=0.7, vy=-turn_mps)
        status = OCCLUDED if time_s == pytest.approx(missed_s) else VISIBLE
        found = selected(selector, time_s, own, person(3, 2 + 0.7 * time_s, 0, status, vx=0.7, first_s=2.25))
    assert found == followed


def test_someone_who_comes_to_where_the_person_stood_is_not_the_person():
    """Who has begun to walk, and is visible all the time."""
    selector = TargetSelector()
    for time_s in np.arange(1, 5, 0.1):
        walked_m = max(time_s - 2, 0)
        stranger = [person(3, 2, -1.2 + 0.5 * walked_m, vy=0.5, first_s=2.05)] if time_s > 2.3 else []
        assert selected(selector, time_s, person(1, 2 + walked_m, 0, vx=float(time_s > 2)), *stranger) == 1


@pytest.mark.parametrize('x, followed', [(4.6, 2), (3.7, 1)])
def test_two_people_who_have_changed_tracks_are_noticed(x, followed):
    """A person stands hidden by the one who walks along x. Their tracks part, and one of them is at x: in the way, or
    where the hidden person was."""
    selector = TargetSelector()
    for time_s in np.arange(0, 3.01, 0.1):
        hidden = OCCLUDED if 2 < time_s < 2.55 else VISIBLE
        selected(selector, time_s, person(1, 2 + 0.7 * time_s, 0, vx=0.7), person(2, 3.6, 0, hidden))
    for time_s in np.arange(3.1, 3.71, 0.1):
        found = selected(selector, time_s, person(1, 4.1, 3 - time_s, vy=-1.0), person(2, x, 0))
    assert found == followed


def test_the_search_ends():
    selector = TargetSelector()
    selected(selector, 1, person(1, 2, 0))
    assert selected(selector, 16.5) is None and selector.has_given_up
    assert selected(selector, 17, person(1, 2, 0)) is None
    without_tracks = TargetSelector()  # or without a pose of the robot
    selected(without_tracks, 1, person(1, 2, 0))
    assert selected(without_tracks, 17, person(1, 2, 0)) is None and without_tracks.has_given_up


class Drive(object):
    """A robot at the origin that obeys the commands for a person on a path; tracks arrive 10 times per second, 0.1 s
    old."""

    def __init__(self, place_after, others=lambda _seconds: [], **params):
        self._place_after, self._others = place_after, others
        self.follower, self.pose = Follower(PARAMS._replace(**params), SAFETY), np.zeros(3)
        self.seconds, self.distances_m, self.velocities = 0.0, [], [(0.0, 0.0)]

    def run(self, seconds):
        for _step in range(int(round(seconds / STEP_S))):
            stamp_s = max(self.seconds - 0.1 - self.seconds % 0.1, 0)
            x, y = self._place_after(stamp_s)
            vx, vy = (np.array(self._place_after(stamp_s + 0.05)) - (x, y)) / 0.05
            tracks = [person(1, x, y, vx=vx, vy=vy)] + self._others(stamp_s)
            robot_from_tracks = np.linalg.inv(upright(*self.pose[:2], z=0, yaw=self.pose[2]))
            self.follower.update(tracks, int(stamp_s * NS), robot_from_tracks)
            velocity = self.follower.command(tracks, self.seconds - stamp_s, robot_from_tracks, STEP_S)
            self.pose, self.seconds = moved(self.pose, np.array(velocity), STEP_S), self.seconds + STEP_S
            self.velocities.append(velocity)
            self.distances_m.append(np.linalg.norm(self.pose[:2] - self._place_after(self.seconds)))
        return self

    def limits_are_kept(self):
        velocities = np.array(self.velocities)
        changes = np.diff(velocities, axis=0) / STEP_S
        return (velocities[:, 0].min() >= 0 and velocities[:, 0].max() <= PARAMS.max_speed
                and np.abs(velocities[:, 1]).max() <= PARAMS.max_rate
                and changes[:, 0].max() <= PARAMS.acceleration + 1e-6
                and changes[:, 0].min() >= -SAFETY.deceleration - 1e-6
                and np.abs(changes[:, 1]).max() <= PARAMS.angular_acceleration + 1e-6)


@pytest.mark.slow
def test_the_robot_follows_around_a_corner():
    drive = Drive(lambda seconds: (2.5 + 0.7 * min(seconds, 8), 0.7 * max(seconds - 8, 0))).run(25)
    assert drive.limits_are_kept() and drive.pose[2] == pytest.approx(np.pi / 2, abs=0.1)
    assert min(drive.distances_m) > 0.8 * PARAMS.distance and drive.distances_m[-1] < 1.2 * PARAMS.distance


def test_the_robot_turns_to_a_person_who_comes_near_and_does_not_reverse():
    drive = Drive(lambda seconds: (max(3.5 - 0.5 * seconds, 1.0), 0.8)).run(8)
    bearing = np.arctan2(0.8 - drive.pose[1], 1.0 - drive.pose[0])
    assert drive.limits_are_kept() and drive.pose[2] == pytest.approx(bearing, abs=0.05)
    assert max(velocity[0] for velocity in drive.velocities[80:]) < 0.1


@pytest.mark.slow
def test_the_robot_waits_for_a_person_who_crosses():
    crossing = Drive(lambda seconds: (4.0 + 0.7 * seconds, 0.0),
                     lambda seconds: [person(2, 3.5, 2.5 - 0.6 * seconds, vy=-0.6)]).run(12)
    alone = Drive(lambda seconds: (4.0 + 0.7 * seconds, 0.0)).run(12)
    assert crossing.limits_are_kept()
    speeds_mps = [np.array(drive.velocities)[60:100, 0].min() for drive in (crossing, alone)]
    assert speeds_mps[0] < 0.3 < 0.7 < speeds_mps[1]
    assert crossing.distances_m[-1] < 4.5  # and goes on behind


def test_the_robot_decelerates_when_the_person_is_lost():
    drive = Drive(lambda seconds: (2.5 + 0.7 * seconds, 0.0)).run(8)
    here = np.linalg.inv(upright(*drive.pose[:2], z=0, yaw=0))
    drive.follower.update([], int((8 + PARAMS.lost_after) * NS), here)
    velocities = [drive.follower.command([], 0.1, here, STEP_S) for _step in range(40)]
    assert velocities[0][0] == pytest.approx(drive.velocities[-1][0] - SAFETY.deceleration * STEP_S)
    assert velocities[-1] == (0.0, 0.0) and drive.follower.person is None


def test_the_robot_does_not_drive_nearer_to_a_person_who_is_no_longer_tracked():
    """It keeps free where the person may be, also until the person counts as lost."""
    standing = person(1, 1.2, 0)._replace(covariance=np.diag([.04, .04, 0, 0, 0, 0]))
    standing = standing._replace(prediction_covariance_m2=np.tile(standing.covariance[:3, :3], (8, 1, 1)))
    follower, speeds_mps = Follower(PARAMS._replace(distance=0.8), SAFETY), []
    for stamp_s, tracks in ((1.0, [standing]), (1.6, [])):
        follower.update(tracks, int(stamp_s * NS), np.eye(4))
        speeds_mps.append([follower.command(tracks, 0.1, np.eye(4), STEP_S)[0] for _step in range(20)][-1])
    assert follower.person.status == OCCLUDED and speeds_mps[1] == pytest.approx(speeds_mps[0], abs=0.01)


def test_another_id_is_followed_at_once_and_other_changes_keep_the_person():
    follower = Follower(PARAMS, SAFETY)
    tracks = [person(1, 2, 0), person(2, 3, 0)]
    follower.update(tracks, NS, np.eye(4))
    follower.reconfigure(PARAMS._replace(distance=2.0), SAFETY)
    follower.update([person(1, 4, 0), person(2, 3, 0)], 2 * NS, np.eye(4))
    assert follower.person.id == 1
    follower.reconfigure(PARAMS._replace(track_id=2), SAFETY)
    follower.update(tracks, 3 * NS, np.eye(4))
    assert follower.person.id == 2


def test_goals_keep_the_distance_and_look_at_the_person():
    follower = Follower(PARAMS, SAFETY)
    assert follower.goal(0.0, np.eye(4)) is None
    follower.update([person(1, 3, 4)], NS, np.eye(4))
    yaw = np.arctan2(4, 3)
    assert follower.goal(0.0, np.eye(4)) == pytest.approx((3.0 * np.cos(yaw), 3.0 * np.sin(yaw), yaw))
    follower.update([person(1, 0.6, 0)], 2 * NS, np.eye(4))
    assert follower.goal(0.0, np.eye(4)) == pytest.approx((0, 0, 0))
