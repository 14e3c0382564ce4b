"""The parameter ~error_model of bbox3d_node: what is wrong with it is said at the start."""
import os

import pytest

from ros_3d_bb.core.event_counter import EventCounter
from ros_3d_bb.pipeline.estimation_stage import Bbox3dParams, EstimationStage, error_model_of

FOLDER = os.path.join(os.path.dirname(os.path.abspath(__file__)), os.pardir, os.pardir, 'config', 'error_models')


def params(path, estimator='foreground'):
    return Bbox3dParams(estimator=estimator, error_model=path)


def test_no_model_is_none():
    assert error_model_of(params('')) is None


@pytest.mark.parametrize('name,estimator', [('d435i_thesis', 'foreground'), ('simulated_d435i', 'foreground'),
                                            ('thesis', 'median')])
def test_the_shipped_models_are_for_their_estimators(name, estimator):
    path, other = os.path.join(FOLDER, name + '.yaml'), {'foreground': 'median', 'median': 'foreground'}[estimator]
    assert error_model_of(params(path, estimator)).provenance.estimator == estimator
    with pytest.raises(ValueError, match='is for the estimator %s, not %s' % (estimator, other)):
        error_model_of(params(path, other))


def test_an_estimator_that_the_model_is_not_for_is_refused_later_too():
    path = os.path.join(FOLDER, 'thesis.yaml')
    lifter = EstimationStage(params(path, 'median'), EventCounter(), None)
    sample = lifter.sample
    with pytest.raises(ValueError, match='is for the estimator median, not foreground'):
        lifter.reconfigure(params(path, 'foreground'))
    assert lifter.sample is sample


def test_a_file_that_is_not_there_is_named():
    with pytest.raises(ValueError, match='/nowhere.yaml.*absolute path expected'):
        error_model_of(params('/nowhere.yaml'))
