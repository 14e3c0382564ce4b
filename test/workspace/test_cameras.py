import pytest
import rosbag

from ros_3d_bb.bags.bag_pipeline import process_bag
from ros_3d_bb.bags.bag_reader import BagError
from ros_3d_bb.bags.process_bag import with_params
from ros_3d_bb.conversions.perception_msgs import stamp_of
from ros_3d_bb.pipeline.people_pipeline import Settings
from ros_3d_bb_lab.evaluation.clear_mot import score
from ros_3d_bb_lab.evaluation.demo.scene_report import panels_of, read_recording
from support.bags import messages_in, scene_bag
from support.two_cameras import Rig

# A person walks from the view of the front camera into that of the left one; another one stands in both views.
SCENE = {'duration': 3.2, 'rate': 6.0, 'robot': {'cameras': [{'name': 'front'}, {'name': 'left', 'yaw': 0.6}]},
         'people': [{'start': [3.0, -0.2], 'moves': [{'to': [2.4, 2.2], 'speed': 0.9}]}, {'start': [4.6, 1.4]}]}
BOTH = with_params(Settings(detector='none'), 'tracker', cameras=['front', 'left'])


@pytest.fixture(scope='module')
def bags(tmp_path_factory):
    """A bag of the scene with its 2D boxes, and the output of process_bag."""
    folder = tmp_path_factory.mktemp('bags')
    path = scene_bag(folder / 'in.bag', SCENE, with_boxes=True)
    process_bag(path, str(folder / 'out.bag'), BOTH)
    return path, str(folder / 'out.bag')


def test_each_person_is_one_track_in_both_views(bags):
    with rosbag.Bag(bags[1]) as bag:
        recording = read_recording(bag)
        assert len(panels_of(bag, recording)) == 6  # the report shows images of both
    assert (len(recording.moments), recording.answered) == (39, 38)  # no tracks until both cameras have sent boxes
    result = score(recording.moments, recording.cameras)
    for person in result.people:
        assert person.visible_s > 2.5, person  # the first one in every second image
        assert len(person.ids) == 1 and person.rmse_m < 0.25, person
    assert result.false_share == 0
    last = recording.moments[-1]
    assert len(last.tracks) == len(last.truth) == 2


def test_boxes_are_in_the_namespaces_and_people_on_one_topic(bags):
    found = messages_in(bags[1])
    frames = {camera: set(message.header.frame_id for message in found['/%s/ros_3d_bb/bb_3d' % camera])
              for camera in ('front', 'left')}
    assert frames == {'front': {'front_color_optical_frame'}, 'left': {'left_color_optical_frame'}}
    stamps = [stamp_of(message) for message in found['/ros_3d_bb/tracks']]
    assert len(stamps) == 38 and stamps == sorted(stamps) and '/ros_3d_bb/bb_3d' not in found


def test_a_camera_missing_in_a_bag_is_named(bags, tmp_path):
    with pytest.raises(BagError, match='no std_msgs/Int32MultiArray on /rear/yolo_bounding_box; did you mean'):
        process_bag(bags[0], str(tmp_path / 'out.bag'), with_params(BOTH, 'tracker', cameras=['front', 'rear']))


@pytest.mark.parametrize('params,complaint', [
    ({'cameras': ['front', 'front']}, 'different namespaces expected'),
    ({'cameras': ['front camera']}, 'different namespaces expected'), ({'cameras': [1]}, 'different namespaces'),
    ({'cameras': ['front', 'rear'], 'camera_frame': 'mount'}, 'expected with a single camera only')])
def test_inconsistent_parameters_are_rejected(params, complaint):
    with pytest.raises(ValueError, match=complaint):
        Rig(*params.pop('cameras'), **params)
