"""Simulated runs of a robot among pedestrians: consistency of detections and ground truth."""
import numpy as np
import pytest

from ros_3d_bb_lab.evaluation.tracking.robot_motion import DRIVING
from ros_3d_bb_lab.evaluation.tracking.run_generator import simulate
from ros_3d_bb_lab.evaluation.tracking.trajectories import made_sequences


@pytest.fixture(scope='module')
def dense():
    return made_sequences(0, 30)[1]


def test_the_same_seed_gives_the_same_images_and_another_one_others(dense):
    first, again, other = (simulate(dense, DRIVING, seed, seconds=1) for seed in ((3, 0), (3, 0), (3, 1)))
    assert len(first.images) == len(again.images)
    for image, same in zip(first.images, again.images):
        assert image.stamp_ns == same.stamp_ns and image.sources == same.sources
        assert all(np.array_equal(a.position_m, b.position_m) for a, b in zip(image.detections, same.detections))
    assert first.images[0].stamp_ns != other.images[0].stamp_ns
