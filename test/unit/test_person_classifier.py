"""Person classifier: HOG scores at known positions, and features of the shape in depth."""
import cv2
import numpy as np
import pytest

from ros_3d_bb.detection.depth.detector import DepthPeople
from ros_3d_bb.detection.depth.person_classifier import (BEST_HOG, LOW_SCORE, PersonHog, PersonWindow, person_score,
                                                         pyramid_of, shape_features_of)


def drawing(window, shape=(480, 640)):
    """Image (height, width, 3) of a grey figure with head, trunk and two legs on a light background."""
    image = np.full(shape + (3,), 190, np.uint8)
    size = window.soles - window.crown
    for x, y, half_width, half_height in ((0, 0.07, 0.05, 0.07), (0, 0.33, 0.14, 0.19), (-0.06, 0.74, 0.05, 0.26),
                                          (0.06, 0.74, 0.05, 0.26)):
        center = int(window.middle + x * size), int(window.crown + y * size)
        cv2.ellipse(image, center, (int(half_width * size), int(half_height * size)), 0, 0, 360, (60, 60, 60), -1)
    return cv2.GaussianBlur(image, (0, 0), 1.0)


def best(hog, pyramid, window):
    """The best score over all scales."""
    scores = list(hog.scores(pyramid, window))
    assert len(scores) == 3 and scores == sorted(scores)
    return scores[-1]


@pytest.mark.parametrize('window', [PersonWindow(320, 60, 440), PersonWindow(150, 200, 300),
                                    PersonWindow(500, 140, 330)])
def test_hog_score_is_positive_only_at_the_person(window):
    hog, image = PersonHog(), drawing(window)
    score = best(hog, pyramid_of(image), window)
    assert score > 0
    assert score == best(hog, pyramid_of(image[..., ::-1].copy()[..., ::-1]), window)  # of a view
    elsewhere = window._replace(middle=640 - window.middle) if window.middle != 320 else PersonWindow(60, 60, 440)
    assert best(hog, pyramid_of(image), elsewhere) == LOW_SCORE


def test_without_hog_the_error_names_what_to_install(monkeypatch):
    monkeypatch.delattr(cv2, 'HOGDescriptor')
    with pytest.raises(ValueError, match='HOGDescriptor.*python3-opencv'):
        DepthPeople()


def cabinet_and_person(noise_m=0.0):
    """(mask, depth_m) of a cabinet at 3 m, and of a person in mid-stride at the same place."""
    depth_m = 3 + noise_m * np.random.RandomState(0).randn(60, 20)
    person = np.ones((60, 20), bool)
    person[:10, :6] = person[:10, 14:] = person[10:, :2] = person[10:, 18:] = person[35:, 9:11] = False
    slanted_m = depth_m.copy()
    slanted_m[35:, :9] -= np.linspace(0, 0.3, 25)[:, None]
    slanted_m[35:, 11:] += np.linspace(0, 0.3, 25)[:, None]
    return (np.ones((60, 20), bool), depth_m), (person, slanted_m)


@pytest.mark.parametrize('noise_m', [0.0, 0.03])
@pytest.mark.parametrize('headless', [False, True])
def test_shape_distinguishes_a_person_from_a_cabinet(noise_m, headless):
    cabinet, person = (shape_features_of(mask, depth_m, 0.3) for mask, depth_m in cabinet_and_person(noise_m))
    assert cabinet[0] == 1 and person[0] < 0.8 and cabinet[1] <= person[1]
    assert person_score(cabinet, BEST_HOG, headless) < person_score(person, BEST_HOG, headless)
    assert person_score(cabinet, BEST_HOG, True) < 0.2 < 0.9 < person_score(person, BEST_HOG, headless)
