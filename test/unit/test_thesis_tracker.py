import numpy as np
import pytest

from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.tracking.thesis_tracker import ThesisTracker, ThesisTrackerParams
from ros_3d_bb.tracking.types import OCCLUDED
from support.people import at


def seconds(value):
    return int(round(value * NS))


def test_ids_start_at_1_and_are_not_reused():
    tracker = ThesisTracker(ThesisTrackerParams(disappearance_limit=0.1))
    assert [track.id for track in tracker.update(0, [at(0, 0), at(5, 0)])] == [1, 2]
    assert tracker.update(seconds(1), []) == []
    assert [track.id for track in tracker.update(seconds(2), [at(0, 0)])] == [3]
    tracker.reset()
    assert [track.id for track in tracker.update(0, [at(0, 0)])] == [4]


def test_velocity_is_averaged_with_alpha():
    """v' = alpha * v_new + (1 - alpha) * v, from zero."""
    tracker = ThesisTracker(ThesisTrackerParams(alpha=0.25))
    tracker.update(0, [at(0, 0)])
    track, = tracker.update(seconds(0.5), [at(1, 0)])
    np.testing.assert_allclose(track.velocity_mps, [0.5, 0, 0])
    track, = tracker.update(seconds(1.0), [at(1, 0)])
    np.testing.assert_allclose(track.velocity_mps, [0.375, 0, 0])
    np.testing.assert_allclose(track.instant_velocity_mps, 0)


@pytest.mark.parametrize('rate_hz', [5, 30])
def test_an_undetected_object_is_deleted_after_the_limit_in_seconds(rate_hz):
    tracker = ThesisTracker(ThesisTrackerParams(disappearance_limit=1.0))
    tracker.update(0, [at(1, 2)])
    for frame in range(1, rate_hz + 1):
        track, = tracker.update(seconds(frame / rate_hz), [])
        assert track.status == OCCLUDED and track.position_m.tolist() == [1, 2, 0.85] and track.last_seen_ns == 0
    assert tracker.update(seconds(1 + 1 / rate_hz), []) == []


def test_tracks_do_not_age_during_skipped_images():
    """tf failed for 10 s: the images in between are skipped."""
    tracker = ThesisTracker(ThesisTrackerParams(disappearance_limit=1.0))
    tracker.update(0, [at(0, 0)])
    for frame in range(1, 300):
        tracker.skip(seconds(frame / 30))
    assert [track.id for track in tracker.update(seconds(10), [])] == [1]
    assert [track.id for track in tracker.update(seconds(10.5), [])] == [1]
    assert tracker.update(seconds(11.1), []) == []


@pytest.mark.parametrize('stamp_s', [1.0, 0.5])
def test_a_late_or_duplicate_image_is_rejected_without_any_change(stamp_s):
    tracker = ThesisTracker()
    tracker.update(seconds(1), [at(0, 0)])
    with pytest.raises(ValueError, match='not later'):
        tracker.update(seconds(stamp_s), [at(5, 5)])
    tracker.skip(seconds(stamp_s))
    assert [track.id for track in tracker.update(seconds(1.1), [at(0, 0)])] == [1]
