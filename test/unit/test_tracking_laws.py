import warnings

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from ros_3d_bb.camera.camera_model import transform_from, transform_points
from ros_3d_bb.core.params import params_from
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.tracking.measurement_model import NoiseParams
from ros_3d_bb.tracking.prediction import PredictionParams
from ros_3d_bb.tracking.tracker import Tracker, TrackerParams
from ros_3d_bb.tracking.types import CameraView
from support.people import CAMERA, START_NS, VIEW, at, ids, mounted, play
from support.states import covariance_of

PERIOD_NS = NS // 30
SEEDS = st.integers(0, 2 ** 32 - 1)
PARAMS = TrackerParams, NoiseParams, PredictionParams


def any_covariance(random):
    """A permitted covariance: standard deviations from 0.03 mm to 9 km, along the axes of the map or any others."""
    axes = np.linalg.qr(random.normal(size=(3, 3)))[0] if random.rand() < 0.5 else np.eye(3)
    variances_m2 = 10.0 ** np.where(random.rand(3) < 0.5, random.uniform(7, 7.9, 3), random.uniform(-9, 0, 3))
    return axes.dot(np.diag(variances_m2)).dot(axes.T)


@settings(max_examples=15, deadline=None)
@given(SEEDS)
def test_covariances_of_tracks_are_positive_definite_whatever_boxes_come(seed):
    """Also of boxes in the place of the camera, for cameras that look anywhere, and after any pause."""
    random, tracker, stamp_ns = np.random.RandomState(seed), Tracker(), START_NS
    with warnings.catch_warnings():
        warnings.simplefilter('error')
        for _image in range(10):
            stamp_ns += int(10 ** random.uniform(-4, 2) * NS)
            places_m = random.choice([0, 1, 3, 3.01, -3], (random.randint(0, 3), 2))
            detections = [at(*place_m, covariance_m2=any_covariance(random)) for place_m in places_m]
            view = CameraView(mounted(1.0, *random.choice([0, 45, 90, 180], 3)), CAMERA)
            tracker.update(stamp_ns, detections, view)
            for track in tracker._buffer.state.tracks:
                covariance = covariance_of(track.state)
                assert np.isfinite(covariance).all() and (np.linalg.eigvalsh(covariance) > 0).all()


@pytest.mark.parametrize('angle', [0, 0.5, np.pi / 4])
def test_nearly_singular_covariances_do_not_stop_the_tracker(angle):
    """Messages may have a variance that rounding makes negative, of up to 1e-9 of the largest one."""
    along, tracker = np.array([np.cos(angle), np.sin(angle), 0]), Tracker()
    covariance_m2 = 1e7 * np.outer(along, along) - 0.005 * np.eye(3)
    play(tracker, 1, lambda _time_s: [at(*3 * along[:2], covariance_m2=covariance_m2)])


def ends_of_sliders():
    """Each live parameter at both ends of its slider."""
    for name, param in ((name, kind.PARAMS[name]) for kind in PARAMS for name in kind._fields):
        for value in param.live if isinstance(param.live, tuple) else ():
            yield pytest.param({name: value}, id='%s-%g' % (name, value))


@pytest.mark.parametrize('changed_at', [0, 20])
@pytest.mark.parametrize('given_params', ends_of_sliders())
def test_a_detected_person_keeps_one_id_at_the_ends_of_all_sliders(given_params, changed_at):
    """The person walks in a slight curve. The parameter is changed before the first image, or after 2 s."""
    random, tracker, published = np.random.RandomState(0), Tracker(), []
    for image in range(60):
        if image == changed_at:
            tracker.reconfigure(*params_from(given_params, *PARAMS))
        x_m, y_m, height_m = (5 - 0.06 * image, 0.3 * np.sin(0.12 * image), 1.7) + random.normal(0, 0.03, 3)
        person = at(x_m, y_m, height_m, score=0.97)
        published.append(ids(tracker.update(START_NS + 3 * image * PERIOD_NS, [person], VIEW)))
    assert published[10:] == [[1]] * 50


@pytest.mark.slow
@settings(max_examples=8, deadline=None)
@given(SEEDS, st.floats(-5e6, 5e6), st.floats(-5e6, 5e6), st.floats(-180, 180))
def test_tracks_are_the_same_anywhere_on_the_map(seed, x_m, y_m, yaw_deg):
    """Moved by thousands of kilometres and turned: positions to a micrometre, IDs and status exactly."""
    moved = transform_from((x_m, y_m, 0), (0, 0, np.sin(np.radians(yaw_deg) / 2), np.cos(np.radians(yaw_deg) / 2)))
    near, far, random = Tracker(), Tracker(), np.random.RandomState(seed)
    places_m = random.uniform((1, -2), (6, 2), (4, 2))
    for image in range(40):
        places_m += random.normal(0, 0.03, places_m.shape)
        centers_m = np.column_stack((places_m, np.full(4, 0.85)))[random.rand(4) < 0.8]
        tracks = []
        for tracker, transform in ((near, np.eye(4)), (far, moved)):
            detections = [at(x, y, covariance_m2=None) for x, y, _z in transform_points(transform, centers_m)]
            view = CameraView(transform.dot(mounted(1.0)), CAMERA)
            tracks.append(tracker.update(START_NS + image * PERIOD_NS, detections, view))
        assert [track[:1] + track[4:8] for track in tracks[0]] == [track[:1] + track[4:8] for track in tracks[1]]
        for here, there in zip(*tracks):
            np.testing.assert_allclose(transform_points(moved, here.position_m), there.position_m, atol=1e-6, rtol=0)
            np.testing.assert_allclose(moved[:3, :3].dot(here.velocity_mps), there.velocity_mps, atol=1e-6)
