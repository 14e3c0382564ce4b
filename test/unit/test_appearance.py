import numpy as np
import pytest

from ros_3d_bb.camera.images import DepthImage
from ros_3d_bb.estimation.appearance import appearance_of
from ros_3d_bb.estimation.box3d_estimator import estimate_boxes, estimator_named
from ros_3d_bb.tracking.tracker import Tracker
from support.people import CAMERA, all_ids, at, ids, play

BLUE, RED = (-0.3, 0.1, 4.0, 0.3, -0.3, 3.5), (0.3, 0.0, 3.6, 0.5, 0.0, 3.2)
SHIRT, TROUSERS, WALL, OTHER = (40, 90, 120), (90, 70, 40), (230, 230, 225), (200, 20, 20)


def image_of_a_person(hidden_columns=0):
    """A person at 3 m before a wall at 5 m, and at 2 m someone else, who hides some of the columns of the box."""
    color, depth = np.full((480, 640, 3), WALL, np.uint8), np.full((480, 640), 5000, np.uint16)
    color[100:240, 280:370], color[240:410, 280:370], depth[100:410, 280:370] = SHIRT, TROUSERS, 2850
    color[:, 280:280 + hidden_columns], depth[:, 280:280 + hidden_columns] = OTHER, 1900
    return color, DepthImage(depth, 0.001)


@pytest.mark.parametrize('hidden_columns', [0, 35])
def test_only_the_person_has_the_colours(hidden_columns):
    color, depth = image_of_a_person(hidden_columns)
    box, = estimate_boxes(depth, [(270, 100, 380, 410)], CAMERA, estimator_named('foreground'))
    if hidden_columns:  # the detector knows where the person is, and the estimate of the layer is tested elsewhere
        box = box._replace(center_m=np.array([0, 0, 3.0]))
    upper, lower = np.log(np.array((SHIRT, TROUSERS)) + 8.0)
    expected = [(r - g, b - g, (r + g + b) / 3) for r, g, b in (upper, lower)]
    assert appearance_of(box, color, depth, CAMERA) == pytest.approx(np.ravel(expected), abs=1e-6)
    assert appearance_of(box._replace(truncated_edges=(False, True, False, False)), color, depth, CAMERA) is None
    nearer = box._replace(center_m=np.array([0, 0, 1.0]))
    assert appearance_of(nearer, color, depth, CAMERA) is None
    infrared = np.repeat(color[..., :1], 3, axis=2)
    assert appearance_of(box, infrared, depth, CAMERA) is None


def visit(colors, start_s, end_s, y=0.0):
    """`detections_at` of someone who stands at (4, y) for a time, in clothes whose colours vary a little."""
    def detections_at(time_s):
        if not start_s <= time_s < end_s:
            return []
        change = 0.05 * np.sin(7 * time_s + np.arange(6))
        return [at(4, y, appearance=colors and tuple(np.array(colors) + change))]
    return detections_at


def visits(*all_of_them, seconds, rate_hz=2.5):
    return play(Tracker(), seconds, lambda time_s: sum((each(time_s) for each in all_of_them), []), rate_hz)


@pytest.mark.parametrize('colors,is_same', [(BLUE, True), (RED, False), (None, False)])
@pytest.mark.parametrize('away_s,rate_hz', [(30, 2.5), (120, 2.5), (30, 15)])
def test_who_returns_in_the_same_clothes_within_minutes_has_the_same_id(colors, is_same, away_s, rate_hz):
    returns_s = 4 + away_s
    published = visits(visit(BLUE, 0, 4), visit(colors, returns_s, returns_s + 4), seconds=returns_s + 4,
                       rate_hz=rate_hz)
    later = all_ids(published[int(returns_s * rate_hz):])
    assert later == {1} if is_same else (len(later) == 1 and later != {1})


def test_who_returns_after_more_than_five_minutes_is_a_new_person():
    published = visits(visit(BLUE, 0, 4), visit(BLUE, 310, 314), seconds=314)
    assert 1 not in all_ids(published[700:])


def test_people_who_are_dressed_alike_get_new_ids():
    """Two were there together, so that the clothes are common. One has left before the third one comes."""
    published = visits(visit(BLUE, 0, 30), visit(BLUE, 0, 6, 1.5), visit(BLUE, 20, 30, 1.5), seconds=30)
    assert ids(published[10]) == [1, 2] and ids(published[-1])[0] == 1
    assert ids(published[-1])[1] not in (1, 2)


@pytest.mark.parametrize('colors', [(BLUE, RED), (BLUE, BLUE), (None, None)])
def test_colours_tell_who_of_two_people_is_who(colors):
    """They meet, stand close together out of view, and both go back to where they came from, or both go on."""
    def walk(turns):
        def detections_at(time_s):
            if 3.5 < time_s < 5.5:
                return []
            way = time_s - 4.5 if time_s < 4.5 or not turns else 4.5 - time_s
            return [at(4, side * 0.6 * way - 0.1 * side, appearance=each) for side, each in zip((1, -1), colors)]
        return detections_at

    for turns in (False, True):
        published = play(Tracker(), 10, walk(turns), rate_hz=5)
        sides = {track.id: np.sign(track.position_m[1]) for track in published[10]}
        later = {track.id: np.sign(track.position_m[1]) for track in published[-1]}
        if colors[0] != colors[1]:
            assert later == {number: side if turns else -side for number, side in sides.items()}
        else:
            assert len(later) == 2
