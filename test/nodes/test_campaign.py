"""A whole measurement campaign: simulated people, viewer_node, the annotator's window, its table and its analysis.

Needs a master for the pipeline, and a display for both windows. The errors at the end are compared with what
bbox3d_node and the simulator said on their topics when the measurements were taken.
"""
import csv
import json
import os
import signal
import subprocess
import time

import numpy as np
import pytest
import rospy

from ros_3d_bb.conversions.perception_msgs import stamp_of
from ros_3d_bb.core.atomic_file import locked_update
from ros_3d_bb.msg import BoundingBox3DArray, TrackedObjectArray
from ros_3d_bb.sessions.session_reader import read_session
from support.ros import Recorder, launched, wait_until
from support.screen import press, start_screen

PLACES_M = ((-0.7, 2.4), (0.0, 3.2), (0.9, 4.0))  # of the people: X and Z in the camera's optical frame
MOUNT_M = 0.17  # of the camera, in front of the map's origin
REPETITIONS = 3  # the least for a variance
COUNT = REPETITIONS * len(PLACES_M)
SCENE = {'duration': 100.0, 'rate': 5.0,
         'people': [{'start': [MOUNT_M + z_m, -x_m], 'facing': 3.1} for x_m, z_m in PLACES_M]}
CHEST_Y_M = -0.5  # in the optical frame, of anybody who stands
MILLIMETRE_M = 0.001 + 1e-9


@pytest.fixture(scope='module')
def screen():
    rospy.init_node('test_campaign')
    return start_screen()


@pytest.fixture(scope='module')
def campaign(screen, tmp_path_factory):
    """(folder of a session taken by pressing s in the viewer's window, expected (estimate x, z, truth x, z) of the
    person whom each measurement is about, (n, 4), metres).
    """
    folder = tmp_path_factory.mktemp('campaign')
    (folder / 'scene.yaml').write_text(json.dumps(SCENE))
    session = str(folder / 'session')
    camera = subprocess.Popen(['rosrun', 'ros_3d_bb', 'simulator_node', '_scenario:=%s' % (folder / 'scene.yaml'),
                               '_wait_for_subscribers:=2'])
    try:
        with Recorder('ground_truth', TrackedObjectArray) as truths, \
                Recorder('ros_3d_bb/bb_3d', BoundingBox3DArray, False) as boxes, \
                launched('measure.launch', 'session:=' + session, 'detector:=depth') as launch:
            boxes.wait_for(3, 60)  # from now on none is missed
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
    """Whom a measurement is about, by number."""
    return min(number // REPETITIONS, len(PLACES_M) - 1)


def expected_m(frames, truths, boxes):
    """(n, 4): estimate x, z and truth x, z of whom each frame is about, of the messages with its stamp."""
    truths, boxes = ({stamp_of(message): message for message in messages} for messages in (truths, boxes))
    rows = []
    for number, frame in enumerate(frames):
        place = truths[frame.stamp_ns].objects[person_of(number)].pose.pose.position
        truth_m = np.array([-place.y, place.x - MOUNT_M])
        centers_m = np.array([(box.center.position.x, box.center.position.z) for box in boxes[frame.stamp_ns].boxes])
        rows.append(np.append(centers_m[np.argmin(np.hypot(*(centers_m - truth_m).T))], truth_m))
    return np.array(rows)


@pytest.fixture(scope='module')
def annotated(campaign):
    """The campaign after somebody has clicked and typed in the annotator's window."""
    folder, expected = campaign
    with locked_update(folder) as content:
        content['grid'] = [{'name': name, 'x': 1000 * x_m, 'z': 1000 * z_m}
                           for name, (x_m, z_m) in zip('ABC', PLACES_M)]
    from support.hands import Hands  # Qt must not come before its display
    hands = Hands(folder)
    for number in range(len(expected)):
        choose_person(hands, number)
        enter_truth(hands, number)
        hands.wait_for(lambda: hands.measurement(number).state == 'annotated')
    assert hands.window.progress.text() == '%d of %d done' % ((len(expected),) * 2)
    hands.close()
    return campaign


def choose_person(hands, number):
    """Click on the chest of whom the measurement is about."""
    x_m, z_m = PLACES_M[person_of(number)]
    u, v = hands.document.camera.project(np.array([x_m, CHEST_Y_M, z_m]))
    hands.click_in_image((u, v))

    def is_chosen():
        measurement = hands.measurement(number)
        x1, y1, x2, y2 = measurement.detections[measurement.person].box_px
        return x1 <= u < x2 and y1 <= v < y2
    hands.wait_for(is_chosen)


def enter_truth(hands, number):
    """Type the first of a person, click the mark on the floor for the second, take the same for the rest."""
    x_m, z_m = PLACES_M[person_of(number)]
    way = number - REPETITIONS * person_of(number)
    if way == 0:
        hands.key('F4', *('%.0f' % (1000 * x_m)), 'Tab', *('%.0f' % (1000 * z_m)), 'Return')
    elif way == 1:
        hands.point_and_click(hands.window.pane.floor, hands.window.pane.floor.place_of(x_m, z_m))
    else:
        hands.key('ctrl+l')


def run_annotator(*arguments):
    return subprocess.check_output(('rosrun', 'ros_3d_bb', 'annotator') + arguments).decode()


def test_everybody_stands_where_the_simulation_has_them_and_is_found_there(campaign):
    _folder, expected = campaign
    places_m = np.array([PLACES_M[person_of(number)] for number in range(len(expected))])
    assert np.abs(expected[:, 2:] - places_m).max() < MILLIMETRE_M
    assert np.abs(expected[:, :2] - places_m).max() < 0.2


def test_the_table_holds_the_errors_of_the_campaign_to_the_millimetre(annotated, tmp_path):
    folder, expected = annotated
    table = str(tmp_path / 'table.csv')
    assert run_annotator('--export', table, folder) == '%s: %d measurements\n' % (table, len(expected))
    with open(table) as stream:
        rows = [{name: int(text) / 1000.0 for name, text in row.items()} for row in csv.DictReader(stream)]
    told = np.array([[row[name] for name in ('X measured', 'Z measured', 'X true', 'Z true', 'X error', 'Z error')]
                     for row in rows])
    errors = np.c_[expected, expected[:, :2] - expected[:, 2:]]
    off = np.abs(told[:, None] - errors[None]).max(axis=-1)  # the table is sorted, and names no measurement
    assert len(told) == len(errors) and off.min(axis=0).max() < MILLIMETRE_M and off.min(axis=1).max() < MILLIMETRE_M


def test_the_analysis_sees_the_same_errors(annotated):
    folder, expected = annotated
    run_annotator('--analyse', folder)
    with open(os.path.join(folder, 'analysis', 'summary.json')) as stream:
        summary = json.load(stream)
    for axis, name in enumerate('xz'):
        truth_m, error_m = expected[:, 2 + axis], expected[:, axis] - expected[:, 2 + axis]
        assert len(summary[name]['clusters']) == len(PLACES_M)
        for cluster in summary[name]['clusters']:
            errors_m = error_m[np.abs(truth_m - cluster['truth_m']) < MILLIMETRE_M]
            assert len(errors_m) == cluster['count'] and abs(errors_m.mean() - cluster['mean_m']) < MILLIMETRE_M


def test_the_session_is_sound(annotated):
    folder, _expected = annotated
    assert 'nothing wrong' in run_annotator('--validate', folder)
