"""measure.launch as for a campaign, the simulator being the camera. Needs a master: it is about all nodes together."""
import os
import signal
import subprocess

import numpy as np
import pytest
import rosbag
import rospy
from std_srvs.srv import Trigger

from ros_3d_bb.sessions.session_reader import read_color, read_depth, read_session
from support.ros import launched, wait_until

SCENE = """
duration: 100.0
rate: 5.0
people:
- {start: [3.0, 0.3], facing: 3.1}
"""
PERSON_M = (-0.3, 2.83)  # to the right of and in front of the camera, which is 0.17 m in front of the robot's origin


@pytest.fixture(scope='module')
def folder(tmp_path_factory):
    """Of a session of three measurements, and of the bag that was recorded beside it."""
    rospy.init_node('test_measure')
    folder = tmp_path_factory.mktemp('a campaign')
    (folder / 'scene.yaml').write_text(SCENE)
    # detector, viewer and recorder: the recorder must not miss what is measured
    camera = subprocess.Popen(['rosrun', 'ros_3d_bb', 'simulator_node', '_scenario:=%s' % (folder / 'scene.yaml'),
                               '_wait_for_subscribers:=3'])
    try:
        with launched('measure.launch', 'session:=%s' % (folder / 'session'), 'record:=%s' % (folder / 'run.bag'),
                      'window:=false', 'detector:=depth', 'label:=A1'):
            rospy.wait_for_service('viewer_node/capture', timeout=30)
            answers = []

            def done():
                answers.append(rospy.ServiceProxy('viewer_node/capture', Trigger)())
                rospy.sleep(0.3)
                return len([answer for answer in answers if answer.success]) == 3
            wait_until(done, 'three measurements', 60)
    finally:
        camera.send_signal(signal.SIGINT)
        camera.wait()
    return str(folder)


def test_the_person_is_where_the_simulation_has_them(folder):
    session = read_session(os.path.join(folder, 'session'))
    assert len(session.frames) == 3
    for frame in session.frames:
        assert len(frame.boxes_px) == 1 and frame.label == 'A1'
        assert frame.estimate_m[[0, 2]] == pytest.approx(PERSON_M, abs=0.15)


def test_the_bag_holds_the_images_that_were_measured(folder):
    session = read_session(os.path.join(folder, 'session'))
    with rosbag.Bag(os.path.join(folder, 'run.bag')) as bag:
        images = {(topic, message.header.stamp.to_nsec()): message.data
                  for topic, message, _time in bag.read_messages(['/camera/color/image_raw',
                                                                  '/camera/aligned_depth_to_color/image_raw'])}
        topics = set(bag.get_type_and_topic_info().topics)
    for frame in session.frames:
        assert images['/camera/color/image_raw', frame.stamp_ns] == np.ascontiguousarray(
            read_color(frame, session.camera)).tobytes()
        depth = read_depth(frame, session)
        assert images['/camera/aligned_depth_to_color/image_raw', frame.stamp_ns] == depth.values.tobytes()
    assert {'/camera/color/camera_info', '/yolo_bounding_box', '/ros_3d_bb/bb_3d', '/ros_3d_bb/tracks', '/tf'} <= topics
