"""Camera and tracks of the Jackal among the people of worlds/people.world."""
import numpy as np
import pytest
import rospy
from gazebo_msgs.msg import ModelState
from gazebo_msgs.srv import SetModelState
from geometry_msgs.msg import Point, Pose, Quaternion, Twist, Vector3

from ros_3d_bb.conversions.perception_msgs import stamp_of
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.msg import TrackedObject

PEOPLE = 'front', 'near', 'far', 'standing'
ROUND_S = 16.0  # the longest round of a person
NEAR_M, ERROR_M = 0.5, 0.2
BODY_M, ROBOT_M = 0.2, 0.21  # from the centre to the surface of a person and to the front of the robot


@pytest.fixture(scope='module')
def people(start):
    with start() as world:
        yield world


def test_each_person_is_tracked_at_the_true_position(people):
    people.tracks.emptied()
    people.pass_s(ROUND_S)
    errors_m = {name: [] for name in PEOPLE}
    for message in people.tracks.messages:
        assert message.header.frame_id == 'odom'
        for track in message.objects:
            position = track.pose.pose.position
            for name in PEOPLE if track.status == TrackedObject.VISIBLE else ():
                error_m = np.hypot(*(people.positions_at(stamp_of(message) / NS, name) - [position.x, position.y]))
                if error_m < NEAR_M:
                    errors_m[name].append(error_m)
    print({name: (len(errors), np.sqrt(np.mean(np.square(errors)))) for name, errors in errors_m.items() if errors})
    for name, errors in errors_m.items():
        assert len(errors) > 0.3 * ROUND_S * people.fps, name  # hidden and out of view at times
        assert np.sqrt(np.mean(np.square(errors))) < ERROR_M, name


def test_the_robot_cannot_drive_through_a_person(people):
    """As the last test, because it moves the robot: to 1.2 m in front of the person, then ahead for 2 m."""
    start = ModelState(model_name='jackal', pose=Pose(Point(7.0, 0.9, 0.07), Quaternion(w=1)))
    assert rospy.ServiceProxy('gazebo/set_model_state', SetModelState)(start).success
    first, end_s = len(people.truth), rospy.get_time() + 4
    velocity = rospy.Publisher('cmd_vel', Twist, queue_size=1)
    while rospy.get_time() < end_s:
        velocity.publish(Twist(linear=Vector3(x=0.5)))
        rospy.sleep(0.05)
    distances_m = [np.linalg.norm(models['jackal'] - models['standing'])
                   for _time_s, models, _yaw in people.truth[first:]]
    print('%.2f m from the centre of the person' % min(distances_m))
    assert abs(min(distances_m) - BODY_M - ROBOT_M) < 0.1
