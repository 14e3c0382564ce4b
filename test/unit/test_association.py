from unittest import mock

import numpy as np
import pytest
from hypothesis import given, strategies as st

from ros_3d_bb.core.object_classes import ObjectClasses
from ros_3d_bb.tracking import association
from ros_3d_bb.tracking.association import allowed_costs, associate
from ros_3d_bb.tracking.kalman_filter import outlier_model
from ros_3d_bb.tracking.measurement_model import BoxNoise, Kinds, measurements_of
from ros_3d_bb.tracking.track import Track
from ros_3d_bb.tracking.tracker import TrackerParams
from ros_3d_bb.tracking.types import CameraView
from support.people import at, mounted

KINDS, VIEW = Kinds(ObjectClasses()), CameraView(mounted(1.0))
SEEDS = st.integers(0, 2 ** 32 - 1)


def measured_at(detections, images=1.0):
    return measurements_of(detections, VIEW, BoxNoise(0.1, 1.0, 0.035, images), KINDS)


def measured(random, count):
    """Measurements of people and chairs in an area of 4 m x 4 m, with standard deviations of 0.03 to 0.6 m."""
    return measured_at([at(3 + random.uniform(-2, 2), random.uniform(-2, 2), random.uniform(1.5, 1.9),
                           sigma=10 ** random.uniform(-1.5, -0.2), label=random.choice(['person', 'person', 'chair']))
                        for _ in range(count)],
                       random.uniform(1, 5))


def scene(seed):
    """Tracks, some not detected for seconds, measurements, and log odds of detection; parameters and their outlier
    model.
    """
    random = np.random.RandomState(seed)
    params = TrackerParams(outlier_share=random.choice([0.0, 0.1, 0.9]), outlier_offset=random.uniform(0, 2),
                           outlier_spread=random.uniform(0, 2), new_target_density=10 ** random.uniform(-9, 1))
    tracks = [Track(number, measurement, 0, '', random.uniform(0, 1), 0.0).predicted(random.uniform(0, 4), 0.08)
              for number, measurement in enumerate(measured(random, random.randint(0, 8)))]
    log_odds = random.choice([0.0, 2.2, 9.0], len(tracks)).tolist()
    return tracks, measured(random, random.randint(0, 8)), log_odds, params, outlier_model(params)


@given(SEEDS)
def test_the_first_look_leaves_out_no_allowed_pair(seed):
    given_scene, gate = scene(seed), association._gate
    costs = allowed_costs(*given_scene)
    with mock.patch.object(association, '_gate', lambda *of: (gate(*of)[0], 0.0, 1e9)):
        assert allowed_costs(*given_scene) == costs


@given(SEEDS)
def test_crowds_have_the_same_costs(seed):
    given_scene = scene(seed)
    few, few_nearer = allowed_costs(*given_scene)
    with mock.patch.object(association, 'CROWD', 1):
        crowd, nearer = allowed_costs(*given_scene)
    assert set(few) == set(crowd) and few_nearer == nearer
    assert [crowd[pair] for pair in few] == pytest.approx(list(few.values()))


def test_a_newcomer_does_not_push_a_person_to_the_track_of_another_one():
    """The person of the second track, hidden before, reappears out of its gate and within that of the first one."""
    def people_at(*places):
        return measured_at([at(3, y, sigma=0.05) for y in places])

    params = TrackerParams()
    outliers = outlier_model(params)
    tracks = [Track(number, measurement, 0, '', 0.8, 0.0).predicted(unseen_s, 0.08)
              for number, measurement, unseen_s in zip((1, 2), people_at(0.0, 0.4), (0.1, 0.3))]
    boxes = people_at(0.05, -0.3)
    assert set(allowed_costs(tracks, boxes, [0.0, 0.0], params, outliers)[0]) == {(0, 0), (0, 1), (1, 0)}
    assert associate(tracks, boxes, [0.0, 0.0], params, outliers) == [(tracks[0], boxes[0])]


def test_people_are_distinguished_by_their_heads_if_feet_are_truncated():
    """A child and an adult, whose positions an error exchanges."""
    def people_at(child_y, adult_y):
        return measured_at([at(2, y, cut='bottom', position_m=(2.0, y, head_m - 0.85), sigma=0.05)
                            for y, head_m in ((child_y, 1.1), (adult_y, 1.8))])
    tracks = [Track(number, measurement, 0, '', 0.8, 0.0) for number, measurement in enumerate(people_at(0.05, -0.05))]
    boxes, params = people_at(-0.05, 0.05), TrackerParams()
    assert associate(tracks, boxes, [0.0, 0.0], params, outlier_model(params)) == list(zip(tracks, boxes))
