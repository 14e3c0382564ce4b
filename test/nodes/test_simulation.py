"""simulation.launch as in `./run demo`: the bag of a scene. Needs a master and simulated time."""
import pytest
import rosbag
import rospy

from ros_3d_bb_lab.evaluation.clear_mot import score
from ros_3d_bb_lab.evaluation.demo.scene_report import read_recording
from support.ros import launched

SCENE = """
duration: 4.0
rate: 10.0
people:
- {start: [4.0, 0.9], facing: 3.0, moves: [{to: [4.0, -0.6], speed: 0.8}]}
- {start: [5.2, -0.8], facing: 2.0}
robot: {moves: [{to: [0.4, 0.0], speed: 0.2}]}
"""


@pytest.fixture(scope='module')
def bag(tmp_path_factory):
    """Bag of a run, in a folder with a space in its name."""
    rospy.init_node('test_simulation')
    folder = tmp_path_factory.mktemp('a scene')
    (folder / 'scene.yaml').write_text(SCENE)
    path = str(folder / 'run.bag')
    with launched('simulation.launch', 'scenario:=%s' % (folder / 'scene.yaml'), 'record:=' + path, 'rviz:=false',
                  'repeat:=false', 'wait_for_subscribers:=2') as process:
        assert process.wait(timeout=120) == 0
    return path


def test_all_people_are_tracked_until_the_end_of_the_scene(bag):
    with rosbag.Bag(bag) as opened:
        result = score(read_recording(opened).moments)
    assert result.images > 30
    assert [person.person for person in result.people] == [1, 2]
    for person in result.people:
        assert len(person.ids) == 1 and person.followed > 0.6 and person.rmse_m < 0.25, person
    assert result.false_share < 0.1


def test_the_bag_has_the_topics_for_playback(bag):
    with rosbag.Bag(bag) as opened:
        topics = opened.get_type_and_topic_info().topics
    assert {'/camera/color/image_raw', '/camera/aligned_depth_to_color/image_raw', '/camera/color/camera_info', '/tf',
            '/ground_truth', '/yolo_bounding_box', '/ros_3d_bb/bb_3d', '/ros_3d_bb/tracks',
            '/visualization_marker_array'} <= set(topics)
    assert not {'/ros_3d_bb/color', '/yolo_result_out'} & set(topics)


def test_boxes_have_the_covariance_of_the_simulated_camera(bag):
    with rosbag.Bag(bag) as opened:
        boxes = [box for _topic, message, _time in opened.read_messages(['/ros_3d_bb/bb_3d']) for box in message.boxes]
    assert len(boxes) > 30
    for box in boxes:
        variances = box.position_covariance[0::4]
        assert 0.01 ** 2 < min(variances) and max(variances) < 0.5 ** 2
