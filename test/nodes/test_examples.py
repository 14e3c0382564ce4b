"""The nodes of examples/ with generated tracks; the C++ node is built as in a workspace of a user."""
import contextlib
import csv
import os
import subprocess

import rospy
from geometry_msgs.msg import TransformStamped, Twist
from std_msgs.msg import Header, Int32
from tf2_msgs.msg import TFMessage

from ros_3d_bb.msg import TrackedObject, TrackedObjectArray
from ros_3d_bb_lab.evaluation.launching import running
from support.code_blocks import ROOT
from support.ros import Recorder, publisher, wait_until

EXAMPLES = os.path.join(ROOT, 'examples')


def tracks_at(*positions_m):
    """People in the map, numbered from 1, at the current time."""
    message = TrackedObjectArray(header=Header(stamp=rospy.Time.now(), frame_id='map'))
    for number, (x_m, y_m) in enumerate(positions_m, 1):
        track = TrackedObject(id=number, label='person')
        track.pose.pose.position.x, track.pose.pose.position.y = x_m, y_m
        message.objects.append(track)
    return message


@contextlib.contextmanager
def seen(*positions_m):
    """Publish these people at 10 Hz until the end of the block: a subscriber may miss the first messages."""
    tracks = rospy.Publisher('ros_3d_bb/tracks', TrackedObjectArray, queue_size=10)
    timer = rospy.Timer(rospy.Duration(0.1), lambda _event: tracks.publish(tracks_at(*positions_m)))
    try:
        yield
    finally:
        timer.shutdown()
        timer.join()


def test_people_in_an_area_are_counted():
    with running([os.path.join(EXAMPLES, 'count_people'), '_area:=[0, 0, 4, 2]']):
        with Recorder('count_people/count', Int32) as counts:
            for positions_m, number in ([(1, 1), (3, 1.9), (3, 2.1), (-1, 1)], 2), ([], 0):
                with seen(*positions_m):
                    wait_until(lambda: counts.messages and counts.messages[-1].data == number, '%d people' % number)


def test_tracks_become_rows(tmp_path):
    path = tmp_path / 'tracks.csv'
    with running([os.path.join(EXAMPLES, 'tracks_to_csv'), '_file:=%s' % path]), seen((1, 2), (3, 4)):
        wait_until(lambda: path.exists() and len(path.read_text().splitlines()) > 2, 'two rows below the header')
    with open(str(path), newline='') as stream:
        rows = [(row['id'], row['label'], float(row['x_m']), float(row['y_m'])) for row in csv.DictReader(stream)]
    assert rows[:2] == [('1', 'person', 1, 2), ('2', 'person', 3, 4)]


def test_the_robot_stops_near_people_and_without_tracks():
    transform = TransformStamped(header=Header(frame_id='map'), child_frame_id='base_link')
    transform.transform.translation.x, transform.transform.rotation.w = 5.0, 1.0
    forward = Twist()
    forward.linear.x = 0.5
    with running([os.path.join(EXAMPLES, 'stop_near_people'), '_timeout:=5']):
        tracks, commands = publisher('ros_3d_bb/tracks', TrackedObjectArray), publisher('cmd_vel_in', Twist)
        transforms = rospy.Publisher('/tf_static', TFMessage, queue_size=1, latch=True)
        with Recorder('cmd_vel', Twist) as velocities:
            def comes_to(speed_mps, *people, **options):
                def has_it():
                    if not options.get('without_tracks'):
                        tracks.publish(tracks_at(*people))
                    commands.publish(forward)
                    rospy.sleep(0.1)
                    return velocities.messages and velocities.messages[-1].linear.x == speed_mps
                wait_until(has_it, 'a speed of %s m/s' % speed_mps)

            comes_to(0.0, (9, 0))  # no transform
            transforms.publish(TFMessage([transform]))
            comes_to(0.5, (9, 0))
            comes_to(0.0, (5.9, 0))
            comes_to(0.5, (6.1, 0))
            comes_to(0.0, without_tracks=True)


def test_the_subscriber_in_cpp_compiles_and_prints(tmp_path):
    build = str(tmp_path)
    subprocess.check_call(['cmake', EXAMPLES], cwd=build, stdout=subprocess.DEVNULL)
    subprocess.check_call(['cmake', '--build', '.'], cwd=build, stdout=subprocess.DEVNULL)
    program = os.path.join(build, 'devel', 'lib', 'ros_3d_bb_examples', 'print_tracks')
    with running([program], stdout=subprocess.PIPE, universal_newlines=True) as process, seen((1.5, -2)):
        assert 'person 1 at 1.50 -2.00 in map, 0.00 m/s to x' in process.stdout.readline()
