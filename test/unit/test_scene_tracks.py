"""How well tracks hold, on synthetic steps with known errors."""
import numpy as np
import pytest

from ros_3d_bb.camera.camera_model import OPTICAL_ROTATION, transform_from
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.tracking.types import OCCLUDED, VISIBLE, TrackedObject
from ros_3d_bb_lab.evaluation.clear_mot import Moment
from ros_3d_bb_lab.evaluation.scene_benchmark import is_in_image, score_tracks
from ros_3d_bb_lab.evaluation.scenes import Step
from ros_3d_bb_lab.simulation.simulator import D435I_COLOR, PersonTruth, Poses, SimulatedFrame

CAMERA_M = (0.0, 0.0, 1.0)
SIZE_M, BOX_PX = np.array([0.5, 0.5, 1.7]), (200, 0, 400, 480)


def person(number, x_m, y_m=0.0, speed_mps=0.0, hidden=0.0, box_px=BOX_PX):
    """Somebody who walks along x. The image border cuts most of the body."""
    return PersonTruth(number, np.array([x_m, y_m, 0.85]), np.array([speed_mps, 0.0, 0.0]), SIZE_M, 0.1, hidden, 0.1,
                       box_px)


def as_track(position_m, velocity_mps, number, status=VISIBLE, horizon_s=2.0):
    """A track with straight predictions each 0.25 s."""
    times_s = np.arange(0.25, horizon_s + 0.01, 0.25)
    return TrackedObject(number, position_m, SIZE_M, velocity_mps, velocity_mps, status, False, 0, 0,
                         position_m + times_s[:, None] * velocity_mps, 0.25)


def track_of(someone, number=1, status=VISIBLE, off_m=(0.0, 0.0, 0.0), off_mps=(0.0, 0.0, 0.0), horizon_s=2.0):
    """The track of a person, off by so much."""
    return as_track(someone.position_m + off_m, someone.velocity_mps + off_mps, number, status, horizon_s)


def step(number, people, tracks):
    poses = Poses(np.eye(4), np.eye(4), transform_from(CAMERA_M, OPTICAL_ROTATION))
    truth = [track_of(someone, someone.id) for someone in people]
    return Step(SimulatedFrame(number, number / 30.0, None, None, poses, people), np.zeros((0, 4)),
                Moment(number * NS // 30, truth, tracks))


def scored(images):
    """The score of images, each (people, tracks)."""
    return score_tracks([step(number, *image) for number, image in enumerate(images)], D435I_COLOR)


def test_errors_of_velocity_and_prediction_are_those_in_the_plane():
    someone = person(1, 3.0, speed_mps=-0.9)
    result = scored([([someone], [track_of(someone, off_m=(0.0, 0.1, 5.0), off_mps=(0.3, 0.0, 7.0))])] * 4)
    assert result['track_ids'] == 1 and result['not_visible'] == 0
    assert result['velocity_rmse_mps'] == pytest.approx(0.3)
    assert result['prediction_1s_m'] == pytest.approx(np.hypot(0.3, 0.1))


def test_images_without_a_visible_track_count_from_the_first_with_one_on():
    someone = person(1, 2.0)
    held, occluded = track_of(someone), track_of(someone, status=OCCLUDED)
    away = track_of(someone, number=2, off_m=(0.0, 0.51, 0.0))
    images = [[], [], [held], [], [occluded], [away], [held]]
    result = scored([([someone], tracks) for tracks in images])
    assert result['not_visible'] == 3 and result['track_ids'] == 1


@pytest.mark.parametrize('gone', [person(1, 0.49), person(1, 3.0, y_m=2.0), person(1, 3.0, hidden=0.71),
                                  person(1, 3.0, box_px=None), person(1, -1.0)])
def test_nothing_is_missed_of_people_who_are_too_near_beside_the_image_or_hidden(gone):
    someone = person(1, 3.0)
    result = scored([([someone], [track_of(someone)]), ([gone], [])])
    assert result['not_visible'] == 0


@pytest.mark.parametrize('x_m', [0.5, 0.6, 8.0])
def test_people_of_whom_the_border_cuts_most_count_down_to_half_a_metre(x_m):
    someone = person(1, x_m)
    result = scored([([someone], [track_of(someone)]), ([someone], [])])
    assert result['not_visible'] == 1


def test_each_id_counts_once_also_that_of_a_second_track_of_one_person():
    someone, other = person(1, 2.0), person(2, 4.0)
    first, second = track_of(someone, 5), track_of(someone, 6, off_m=(0.2, 0.0, 0.0))
    nobody = track_of(person(3, 7.0), 7)
    result = scored([([someone, other], [first, track_of(other, 8), nobody]), ([someone, other], [first, second])])
    assert result['track_ids'] == 3 and result['not_visible'] == 1


def test_what_is_not_known_is_none():
    someone = person(1, 2.0)
    assert scored([([someone], [])]) == {
        'track_ids': 0, 'not_visible': 0, 'velocity_rmse_mps': None, 'prediction_1s_m': None}
    short = scored([([someone], [track_of(someone, horizon_s=0.5)])])
    assert short['velocity_rmse_mps'] == 0 and short['prediction_1s_m'] is None


def test_a_person_is_in_the_image_while_the_axis_is():
    map_from_camera = transform_from(CAMERA_M, OPTICAL_ROTATION)
    edge_m = 3.0 * 319.2 / 614.686  # of the left border, 3 m ahead
    assert is_in_image(person(1, 3.0, edge_m - 0.01), map_from_camera, D435I_COLOR)
    assert not is_in_image(person(1, 3.0, edge_m + 0.01), map_from_camera, D435I_COLOR)
