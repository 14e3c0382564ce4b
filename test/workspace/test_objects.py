import pytest

from ros_3d_bb.bags.bag_pipeline import process_bag
from ros_3d_bb.bags.bag_writer import write_bag
from ros_3d_bb.bags.process_bag import with_params
from ros_3d_bb.conversions.perception_msgs import BOXES3D_TOPIC, TRACKS_TOPIC, tracks_from_msg, usable_boxes3d
from ros_3d_bb.pipeline.people_pipeline import Settings
from ros_3d_bb_lab.evaluation.clear_mot import Moment, score
from ros_3d_bb_lab.evaluation.defaults import SIMULATED_ERROR_MODEL, scenario_path
from ros_3d_bb_lab.simulation.ros.scenario_to_bag import TRUTH_TOPIC, scenario_images
from ros_3d_bb_lab.simulation.scenario import read_scenario
from support.bags import messages_in

LABELS = ['chair', 'dog', 'person', 'trolley']
pytestmark = pytest.mark.slow


@pytest.fixture(scope='module')
def run(tmp_path_factory):
    """[(truth, 3D boxes, tracks)] of the first 5 s of config/scenarios/objects.yaml."""
    source, target = (str(tmp_path_factory.mktemp('bags') / name) for name in ('in.bag', 'out.bag'))
    scenario = read_scenario(scenario_path('objects'))._replace(duration=5.0)
    write_bag(scenario_images(scenario, with_boxes=True), source)
    process_bag(source, target, with_params(Settings(detector='none'), 'bbox3d', error_model=SIMULATED_ERROR_MODEL))
    found = messages_in(target)
    return list(zip(*(found['/' + topic] for topic in (TRUTH_TOPIC, BOXES3D_TOPIC, TRACKS_TOPIC))))


def test_each_object_is_one_track_with_its_label(run):
    moments = [Moment(truth.header.stamp.to_nsec(), tracks_from_msg(truth), tracks_from_msg(tracks))
               for truth, _boxes3d, tracks in run]
    labels = {track.id: track.label for track in moments[0].truth}
    scores = score(moments)
    assert sorted(labels.values()) == LABELS and scores.false_share == 0
    published = {(track.id, track.label) for moment in moments for track in moment.tracks}
    assert sorted(label for _id, label in published) == LABELS  # one track each, whose label never changes
    for found in scores.people:
        assert (found.ids[0], labels[found.person]) in published and len(found.ids) == 1
        assert found.detected > 0.9 and found.rmse_m <= 0.08, labels[found.person]


def test_tracks_name_the_box_that_they_were_detected_as(run):
    detected = 0
    for _truth, boxes3d, tracks in run:
        assert boxes3d.header.stamp == tracks.header.stamp
        boxes, _faults = usable_boxes3d(boxes3d)
        indices = [track.detection for track in tracks.objects if track.detection >= 0]
        assert len(set(indices)) == len(indices)
        for track in tracks.objects:
            assert (track.detection >= 0) == (track.last_seen == tracks.header.stamp)
            if track.detection >= 0:
                assert boxes[track.detection].label == track.label
                detected += 1
    assert detected > 0.9 * 4 * len(run)


def test_objects_have_the_size_of_their_class(run):
    heights_m = {track.label: track.size.z for track in run[-1][2].objects}
    truth_m = {track.label: track.size.z for track in run[-1][0].objects}
    assert all(abs(heights_m[label] - truth_m[label]) < 0.15 for label in LABELS), heights_m
    assert all(track.size.x < 0.8 and track.score == 1.0 for track in run[-1][2].objects)
