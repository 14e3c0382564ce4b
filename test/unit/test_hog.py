"""OpenCV's HOG people detector at a known place, and what in depth tells a person from furniture."""
import cv2
import numpy as np
import pytest

from ros_3d_bb.detection.depth_people import DepthPeople
from ros_3d_bb.detection.hog import BEST_HOG, LOW_SCORE, Figure, PersonHog, evidence_of, person_score, pyramid_of


def drawing(figure, shape=(480, 640)):
    """A grey figure, head, trunk and two legs, on a light ground, (height, width, 3)."""
    image = np.full(shape + (3,), 190, np.uint8)
    size = figure.soles - figure.crown
    for x, y, half_width, half_height in ((0, 0.07, 0.05, 0.07), (0, 0.33, 0.14, 0.19), (-0.06, 0.74, 0.05, 0.26),
                                          (0.06, 0.74, 0.05, 0.26)):
        center = int(figure.middle + x * size), int(figure.crown + y * size)
        cv2.ellipse(image, center, (int(half_width * size), int(half_height * size)), 0, 0, 360, (60, 60, 60), -1)
    return cv2.GaussianBlur(image, (0, 0), 1.0)


@pytest.mark.parametrize('figure', [Figure(320, 60, 440), Figure(150, 200, 300), Figure(500, 140, 330)])
def test_a_figure_where_it_is_expected_looks_like_a_person(figure):
    hog, image = PersonHog(), drawing(figure)
    score = hog.score(pyramid_of(image), figure)
    assert score > 0
    assert score == hog.score(pyramid_of(image[..., ::-1].copy()[..., ::-1]), figure)  # a view is as good as a copy
    elsewhere = figure._replace(middle=640 - figure.middle) if figure.middle != 320 else Figure(60, 60, 440)
    assert hog.score(pyramid_of(image), elsewhere) == LOW_SCORE


def test_a_figure_may_lie_partly_outside_the_image():
    figure = Figure(300, -40, 440)
    assert PersonHog().score(pyramid_of(drawing(figure)), figure) > LOW_SCORE
    assert PersonHog().score(pyramid_of(drawing(figure)), Figure(-500, 900, 1200)) == LOW_SCORE


def test_opencv_without_hog_says_what_to_install(monkeypatch):
    monkeypatch.delattr(cv2, 'HOGDescriptor')
    with pytest.raises(ValueError, match='no HOGDescriptor.*xobjdetect.*install OpenCV 3.2 to 4.x'):
        DepthPeople()


def upright(noise_m=0.0):
    """A cabinet 3 m away, and the same with the outline and the relief of a person in mid-stride: (mask, depth_m)."""
    depth_m = 3 + noise_m * np.random.RandomState(0).randn(60, 20)
    person = np.ones((60, 20), bool)
    person[:10, :6] = person[:10, 14:] = person[10:, :2] = person[10:, 18:] = person[35:, 9:11] = False
    slanted_m = depth_m.copy()
    slanted_m[35:, :9] -= np.linspace(0, 0.3, 25)[:, None]
    slanted_m[35:, 11:] += np.linspace(0, 0.3, 25)[:, None]
    return (np.ones((60, 20), bool), depth_m), (person, slanted_m)


@pytest.mark.parametrize('noise_m', [0.0, 0.03])
@pytest.mark.parametrize('headless', [False, True])
def test_shape_tells_a_person_from_a_cabinet(noise_m, headless):
    cabinet, person = (evidence_of(mask, depth_m, 0.3) for mask, depth_m in upright(noise_m))
    assert cabinet[0] == 1 and person[0] < 0.8 and cabinet[1] <= person[1]
    assert person_score(cabinet, BEST_HOG, headless) < person_score(person, BEST_HOG, headless)
    assert person_score(cabinet, BEST_HOG, True) < 0.2 < 0.9 < person_score(person, BEST_HOG, headless)


def test_colour_counts_more_where_the_head_is_in_view():
    person = evidence_of(*(upright()[1] + (0.3,)))
    gains = [person_score(person, 0.5, headless) - person_score(person, LOW_SCORE, headless)
             for headless in (False, True)]
    assert gains[0] > gains[1] > 0


def test_looser_than_a_person_is_no_better():
    mask = np.zeros((60, 20), bool)
    mask[::6] = mask[:, 0] = mask[:, 19] = True
    assert mask.mean() < 0.3
    assert evidence_of(mask, np.full(mask.shape, 3.0), 0.3)[0] == 0.5
