import pytest

from ros_3d_bb.core.object_classes import ObjectClasses
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.tracking.measurement_model import Kinds
from ros_3d_bb.tracking.tracker import Tracker
from ros_3d_bb.tracking.types import NOT_DETECTED, VISIBLE
from support import people
from support.people import VIEW


def at(x, y, label='person', score=0.0, index=0):
    return people.at(x, y, height=1.0, sigma=0.03, label=label, score=score, index=index)


def play(tracker, images):
    return [tracker.update(number * NS // 30, detections, VIEW) for number, detections in enumerate(images)]


def test_a_track_has_the_class_of_its_detections():
    tracks = play(Tracker(), [[at(3, -1, 'dog', 0.75, 0), at(3, 1, 'chair', 0.5, 1)]] * 10)[-1]
    assert [(track.label, track.detection) for track in tracks] == [('dog', 0), ('chair', 1)]
    assert [track.score for track in tracks] == pytest.approx([0.75, 0.5])


def test_tracks_never_change_between_groups():
    """A person walks past a chair and stops in its place."""
    images = [[at(3, 0.04 * number - 1.2, 'person'), at(3, 0, 'chair')] for number in range(30)]
    images += [[at(3, 0, 'chair')]] * 15 + [[at(3, 0, 'person')]] * 15
    labels = {}
    for tracks in play(Tracker(), images):
        for track in tracks:
            labels.setdefault(track.id, set()).add(track.label)
    assert sorted(map(sorted, labels.values())) >= [['chair'], ['person']]
    assert all(len(names) == 1 for names in labels.values())


def test_two_objects_of_different_groups_may_be_at_one_place():
    tracks = play(Tracker(), [[at(3, 0, 'person'), at(3, 0.05, 'backpack')]] * 10)[-1]
    assert [track.label for track in tracks] == ['person', 'backpack']


def test_the_label_is_the_most_probable_class_of_the_group():
    """A detector confuses a dog with a cat in two of five images."""
    confused = [[at(3, 0, 'cat', 0.5) if number % 5 < 2 else at(3, 0, 'dog', 0.5)] for number in range(60)]
    published = play(Tracker(), confused)
    assert set(track.id for tracks in published for track in tracks) == {1}
    assert {track.label for tracks in published[20:] for track in tracks} == {'dog'}
    higher_score = [[at(3, 0, 'cat', 0.9) if number % 5 < 2 else at(3, 0, 'dog', 0.3)] for number in range(60)]
    assert play(Tracker(), higher_score)[-1][0].label == 'cat'


def test_a_track_that_was_not_detected_has_no_detection():
    seen, missed, again = play(Tracker(), [[at(3, 0, index=2)]] * 10 + [[]] + [[at(3, 0, index=1)]])[-3:]
    assert [tracks[0].detection for tracks in (seen, missed, again)] == [2, NOT_DETECTED, 1]


def test_the_detection_is_that_of_the_newest_image_after_a_late_one():
    tracker = Tracker()
    play(tracker, [[at(3, 0, index=0)]] * 10)
    tracker.update(11 * NS // 30, [at(3, 0, index=3)], VIEW)
    track, = tracker.update(10 * NS // 30, [at(3, 0, index=5)], VIEW)
    assert (track.detection, track.status) == (3, VISIBLE)


def test_class_names_that_are_not_listed_are_not_kept():
    """Boxes may have any number of them."""
    table = ObjectClasses()
    kinds = Kinds(table)
    listed = len(kinds)
    assert kinds['pet'].group != kinds['dog'].group == kinds['cat'].group
    assert kinds['class 3'] == kinds['class 3'] and kinds['class 3'].members == ('class 3',)
    assert len(kinds) == listed == len(table.listed)


def test_furniture_moves_less_than_people():
    """A jump of the measured position moves a chair less."""
    moved_m = {}
    for label in ('chair', 'person'):
        images = [[at(3, 0, label)]] * 60 + [[at(3, 0.2, label)]] * 5
        moved_m[label] = play(Tracker(), images)[-1][0].position_m[1]
    assert 0 < moved_m['chair'] < 0.7 * moved_m['person']
