
import numpy as np
import pytest
from hypothesis import given, strategies as st

from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.tracking.types import OCCLUDED, VISIBLE
from ros_3d_bb_lab.evaluation.clear_mot import GATE_M, Moment, score
from ros_3d_bb_lab.evaluation.matching import plane_distances
from ros_3d_bb_lab.evaluation.tracking.metrics import trackeval_results
from support.tracks import track_at


def at(number, x, y, status=VISIBLE):
    return track_at([x, y, 0.9], [0, 0, 0], number=number)._replace(status=status)


def moments(*images):
    """Two images a second; each is (people, tracks)."""
    return [Moment(number * NS // 2, truth, tracks) for number, (truth, tracks) in enumerate(images)]


@pytest.mark.needs('trackeval')
@given(st.integers(0, 2 ** 32 - 1))
def test_id_switches_are_those_of_trackeval(seed):
    random = np.random.RandomState(seed)
    images = [([at(number, *random.uniform(0, 2, 2)) for number in range(random.randint(0, 4))],
               [at(number, *random.uniform(0, 2, 2)) for number in range(random.randint(0, 4))]) for _ in range(12)]
    result, clear = score(moments(*images)), clear_of(images)
    assert sum(person.switches for person in result.people) == clear['IDSW']
    assert result.false_share * len(images) == pytest.approx(clear['CLR_FP'])


def clear_of(images):
    """TrackEval's CLEAR metric of images (people, tracks)."""
    people, tracks = ([np.array([thing.id for thing in objects], int) for objects in column] for column in zip(*images))
    similarities = [1 - plane_distances(places(seen), places(tracked)) / (2 * GATE_M) for seen, tracked in images]
    _hota, clear, _identity = trackeval_results(people, tracks, similarities)
    return clear


def places(objects):
    return np.array([thing.position_m for thing in objects]).reshape(-1, 3)


ONE, HIDDEN, TRACK = at(1, 0, 0), at(1, 0, 0, OCCLUDED), at(5, 0, 0)


@pytest.mark.parametrize('images,detected,tracked', [
    ([([ONE], [TRACK]), ([HIDDEN], []), ([HIDDEN], [at(6, 0.5, 0)]), ([ONE], [TRACK])], 1, 1),  # only visible people
    ([([ONE], [TRACK]), ([at(1, 0.2, 0)], [at(5, 0, 0, OCCLUDED)])], 1 / 2, 1),  # the track of a person who is hidden
    ([([ONE], [TRACK]), ([ONE], [at(5, 2, 0, OCCLUDED), at(6, 0, 0, OCCLUDED)])], 1 / 2, 1 / 2),  # no track nearby
    ([([ONE], [TRACK]), ([ONE], []), ([ONE], [at(5, 0.4, 0), at(6, 0.1, 0)])], 2 / 3, 2 / 3)])  # a match kept
def test_only_visible_people_and_tracks_are_matched(images, detected, tracked):
    person, = score(moments(*images)).people
    assert person.ids == [5] and (person.detected, person.tracked) == pytest.approx((detected, tracked))
