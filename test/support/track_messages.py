"""A track as a message."""
import genpy
from geometry_msgs.msg import Point, PoseWithCovariance, Vector3

from ros_3d_bb.msg import TrackedObject


def person(number, x, y, moving=True, speed=1.0):
    """A track that walks along x of the map, predicted for 2 s."""
    track = TrackedObject(id=number, moving=moving, prediction_step=genpy.Duration(2), size=Vector3(0.6, 0.6, 1.7))
    track.pose.pose.position = Point(x, y, 0.85)
    track.twist.twist.linear.x = speed
    track.prediction = [PoseWithCovariance()]
    track.prediction[0].pose.position = Point(x + 2 * speed, y, 0.85)
    return track
