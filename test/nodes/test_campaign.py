"""A measurement campaign: simulated people, measure.launch, the annotator's window, its table and its analysis.

Needs a master for the pipeline, and a display for both windows. The errors at the end are compared with the messages of
bbox3d_node and the simulator at the stamps of the measurements.
"""
import csv
import json
import os
import signal
import subprocess
import time

import numpy as np
import pytest
import rosbag
import rospy

from ros_3d_bb.conversions.perception_msgs import stamp_of
from ros_3d_bb.core.atomic_file import locked_update
from ros_3d_bb.msg import BoundingBox3DArray, TrackedObjectArray
from ros_3d_bb.sessions.session_reader import read_color, read_depth, read_session
from support.ros import Recorder, launched, wait_until
from support.screen import press, start_screen

COLOR, DEPTH = '/camera/color/image_raw', '/camera/aligned_depth_to_color/image_raw'
POSITIONS_M = ((-0.7, 2.4), (0.0, 3.2), (0.9, 4.0))  # of the people: X and Z in the camera's optical frame
MOUNT_M = 0.17  # of the camera, in front of the map's origin
REPETITIONS = 3  # minimum for a variance
COUNT = REPETITIONS * len(POSITIONS_M)
SCENE = {'duration': 100.0, 'rate': 5.0,
         'people': [{'start': [MOUNT_M + z_m, -x_m], 'facing': 3.1} for x_m, z_m in POSITIONS_M]}
CHEST_Y_M = -0.5  # of a standing person in the optical frame
MILLIMETRE_M = 0.001 + 1e-9


@pytest.fixture(scope='module')
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp('a campaign')


@pytest.fixture(scope='module')
def campaign(folder):
    """(session taken by pressing s in the viewer's window, expected estimate x, z and truth x, z in metres, (n, 4))."""
    rospy.init_node('test_campaign')
    start_screen()
    (folder / 'scene.yaml').write_text(json.dumps(SCENE))
    session = str(folder / 'session')
    # detector, viewer and recorder of the bag: none may miss an image that is measured
    camera = subprocess.Popen(['rosrun', 'ros_3d_bb', 'simulator_node', '_scenario:=%s' % (folder / 'scene.yaml'),
                               '_wait_for_subscribers:=3'])
    try:
        with Recorder('ground_truth', TrackedObjectArray) as truths, \
                Recorder('ros_3d_bb/bb_3d', BoundingBox3DArray, False) as boxes, \
                launched('measure.launch', 'session:=' + session, 'detector:=depth', 'label:=A1',
                         'record:=%s' % (folder / 'run.bag')) as launch:
            boxes.wait_for(3, 60)  # from now on, all messages are recorded
            take_measurements(session)
            press('ros_3d_bb viewer', 'q')
            launch.wait()
            return session, expected_m(read_session(session).frames, truths.messages, boxes.messages)
    finally:
        camera.send_signal(signal.SIGINT)
        camera.wait()


def take_measurements(session):
    """Press s until there are enough."""
    def done():
        press('ros_3d_bb viewer', 's')
        time.sleep(0.2)
        return os.path.exists(os.path.join(session, 'frames.json')) and len(read_session(session).frames) >= COUNT
    wait_until(done, '%d measurements' % COUNT, 60)


def person_of(number):
    """The person that a measurement is annotated for, by number."""
    return min(number // REPETITIONS, len(POSITIONS_M) - 1)


def expected_m(frames, truths, boxes):
    """(n, 4): estimate x, z and truth x, z of the person of each frame, from the messages with its stamp."""
    truths, boxes = ({stamp_of(message): message for message in messages} for messages in (truths, boxes))
    rows = []
    for number, frame in enumerate(frames):
        position = truths[frame.stamp_ns].objects[person_of(number)].pose.pose.position
        truth_m = np.array([-position.y, position.x - MOUNT_M])
        centers_m = np.array([(box.center.position.x, box.center.position.z) for box in boxes[frame.stamp_ns].boxes])
        rows.append(np.append(centers_m[np.argmin(np.hypot(*(centers_m - truth_m).T))], truth_m))
    return np.array(rows)


@pytest.fixture(scope='module')
def annotated(campaign):
    """The campaign after annotation by clicks and keys in the annotator's window."""
    session, expected = campaign
    with locked_update(session) as content:
        content['grid'] = [{'name': name, 'x': 1000 * x_m, 'z': 1000 * z_m}
                           for name, (x_m, z_m) in zip('ABC', POSITIONS_M)]
    from support.hands import Hands  # Qt must be imported after the display was started
    hands = Hands(session)
    for number in range(len(expected)):
        choose_person(hands, number)
        enter_truth(hands, number)
        hands.wait_for(lambda: hands.measurement(number).state == 'annotated')
    assert hands.window.progress.text() == '%d of %d done' % ((len(expected),) * 2)
    hands.close()
    return campaign


def choose_person(hands, number):
    """Click on the chest of the person of a measurement."""
    x_m, z_m = POSITIONS_M[person_of(number)]
    u, v = hands.document.camera.project(np.array([x_m, CHEST_Y_M, z_m]))
    hands.click_in_image((u, v))

    def is_chosen():
        measurement = hands.measurement(number)
        x1, y1, x2, y2 = measurement.detections[measurement.person].box_px
        return x1 <= u < x2 and y1 <= v < y2
    hands.wait_for(is_chosen)


def enter_truth(hands, number):
    """Type the truth of a person's first measurement, click the mark for the second, repeat it for the others."""
    x_m, z_m = POSITIONS_M[person_of(number)]
    repetition = number - REPETITIONS * person_of(number)
    if repetition == 0:
        hands.key('F4', *('%.0f' % (1000 * x_m)), 'Tab', *('%.0f' % (1000 * z_m)), 'Return')
    elif repetition == 1:
        hands.point_and_click(hands.window.pane.floor, hands.window.pane.floor.place_of(x_m, z_m))
    else:
        hands.key('ctrl+l')


def run_annotator(*arguments):
    return subprocess.check_output(('rosrun', 'ros_3d_bb', 'annotator') + arguments).decode()


def test_people_are_measured_at_their_simulated_positions(campaign):
    session, expected = campaign
    assert all(frame.label == 'A1' for frame in read_session(session).frames)
    positions_m = np.array([POSITIONS_M[person_of(number)] for number in range(len(expected))])
    assert np.abs(expected[:, 2:] - positions_m).max() < MILLIMETRE_M
    assert np.abs(expected[:, :2] - positions_m).max() < 0.2


def test_the_bag_contains_the_measured_images(campaign, folder):
    session = read_session(campaign[0])
    with rosbag.Bag(str(folder / 'run.bag')) as bag:
        images = {(topic, message.header.stamp.to_nsec()): message.data
                  for topic, message, _time in bag.read_messages([COLOR, DEPTH])}
        topics = set(bag.get_type_and_topic_info().topics)
    for frame in session.frames:
        color, depth = read_color(frame, session.camera), read_depth(frame, session)
        assert images[COLOR, frame.stamp_ns] == np.ascontiguousarray(color).tobytes()
        assert images[DEPTH, frame.stamp_ns] == depth.values.tobytes()
    assert {'/camera/color/camera_info', '/yolo_bounding_box', '/ros_3d_bb/bb_3d', '/ros_3d_bb/tracks', '/tf'} <= topics


def test_the_table_contains_the_errors_of_the_campaign_to_the_millimetre(annotated, tmp_path):
    session, expected = annotated
    table = str(tmp_path / 'table.csv')
    assert run_annotator('--export', table, '--thesis-form', session) == '%s: %d rows\n' % (table, len(expected))
    with open(table) as stream:
        rows = [{name: int(text) / 1000.0 for name, text in row.items()} for row in csv.DictReader(stream)]
    written = np.array([[row[name] for name in ('X measured', 'Z measured', 'X true', 'Z true', 'X error', 'Z error')]
                        for row in rows])
    errors = np.c_[expected, expected[:, :2] - expected[:, 2:]]
    off = np.abs(written[:, None] - errors[None]).max(axis=-1)  # the table is sorted, without IDs of measurements
    assert len(written) == len(errors)
    assert off.min(axis=0).max() < MILLIMETRE_M and off.min(axis=1).max() < MILLIMETRE_M


def test_the_analysis_contains_the_same_errors_and_the_session_is_valid(annotated):
    session, expected = annotated
    run_annotator('--analyse', session)
    with open(os.path.join(session, 'analysis', 'summary.json')) as stream:
        summary = json.load(stream)
    for axis, name in enumerate('xz'):
        truth_m, error_m = expected[:, 2 + axis], expected[:, axis] - expected[:, 2 + axis]
        assert len(summary[name]['clusters']) == len(POSITIONS_M)
        for cluster in summary[name]['clusters']:
            errors_m = error_m[np.abs(truth_m - cluster['truth_m']) < MILLIMETRE_M]
            assert len(errors_m) == cluster['count'] and abs(errors_m.mean() - cluster['mean_m']) < MILLIMETRE_M
    assert ', 0 problems' in run_annotator('--validate', session)
