"""simulation.launch as in `./run demo`, with one and with two cameras. Needs a master.

The scene with two cameras is about the names of all nodes and topics together; test_scenes_in_bags.py compares tracks
with the truth.
"""
import os

import rosbag
import yaml

from ros_3d_bb.conversions.perception_msgs import stamp_of
from ros_3d_bb_lab.evaluation.clear_mot import score
from ros_3d_bb_lab.evaluation.demo.scene_report import read_recording
from support.ros import launched

SCENE = {'duration': 4.0, 'rate': 10.0, 'robot': {'moves': [{'to': [0.4, 0.0], 'speed': 0.2}]}, 'people': [
    {'start': [4.0, 0.9], 'facing': 3.0, 'moves': [{'to': [4.0, -0.6], 'speed': 0.8}]},
    {'start': [5.2, -0.8], 'facing': 2.0}]}
TWO_CAMERAS = os.path.join(os.path.dirname(__file__), '..', '..', 'config', 'scenarios', 'two_cameras.yaml')


def recorded(folder, scene, *arguments):
    """Bag of a run of a scene, in a folder with a space in its name."""
    folder = folder / 'a scene'
    folder.mkdir()
    (folder / 'scene.yaml').write_text(yaml.safe_dump(scene))
    path = str(folder / 'run.bag')
    with launched('simulation.launch', 'scenario:=%s' % (folder / 'scene.yaml'), 'record:=' + path, 'rviz:=false',
                  'repeat:=false', *arguments) as process:
        assert process.wait(timeout=180) == 0
    return path


def test_all_people_are_tracked_until_the_end_of_the_scene(tmp_path):
    with rosbag.Bag(recorded(tmp_path, SCENE, 'wait_for_subscribers:=2')) as bag:
        result, topics = score(read_recording(bag).moments), set(bag.get_type_and_topic_info().topics)
        boxes = [box for _topic, message, _time in bag.read_messages(['/ros_3d_bb/bb_3d']) for box in message.boxes]
    assert result.images > 30 and [person.person for person in result.people] == [1, 2]
    for person in result.people:
        assert len(person.ids) == 1 and person.detected > 0.6 and person.rmse_m < 0.25, person
    assert result.false_share < 0.1
    assert {'/camera/color/image_raw', '/camera/aligned_depth_to_color/image_raw', '/camera/color/camera_info', '/tf',
            '/ground_truth', '/yolo_bounding_box', '/ros_3d_bb/bb_3d', '/ros_3d_bb/tracks',
            '/visualization_marker_array'} <= topics  # those for playback
    assert not {'/ros_3d_bb/color', '/yolo_result_out'} & topics
    assert len(boxes) > 30 and all(0.01 ** 2 < variance < 0.5 ** 2  # those of the simulated camera
                                   for box in boxes for variance in box.position_covariance[0::4])


def test_each_camera_has_its_topics_and_the_tracks_have_one(tmp_path):
    """The first seconds of the scenario, with five images a second from each camera."""
    with open(TWO_CAMERAS) as stream:
        scene = yaml.safe_load(stream)
    room = os.path.join(os.path.dirname(os.path.realpath(TWO_CAMERAS)), scene['room'])
    path = recorded(tmp_path, dict(scene, room=room, duration=4.0), 'cameras:=front, left', 'rate:=5.0')
    with rosbag.Bag(path) as bag:
        topics = set(bag.get_type_and_topic_info().topics)
        stamps = [stamp_of(message) for _topic, message, _time in bag.read_messages('/ros_3d_bb/tracks')]
    for camera in ('front', 'left'):
        assert {'/%s/%s' % (camera, name) for name in (
            'color/image_raw', 'aligned_depth_to_color/image_raw', 'color/camera_info', 'yolo_bounding_box',
            'ros_3d_bb/bb_3d')} <= topics
    assert {'/ros_3d_bb/tracks', '/visualization_marker_array'} <= topics
    assert len(stamps) > 10 and stamps == sorted(stamps)
