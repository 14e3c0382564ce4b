"""A track as a message."""
import numpy as np
from std_msgs.msg import Header

from ros_3d_bb.conversions.perception_msgs import tracks_to_msg
from support.tracks import track_at


def person(number, x, y, moving=True, speed=1.0):
    """A track that walks along x of the map, predicted for 2 s."""
    track = track_at((x, y, 0.85), (speed, 0, 0), moving=moving, number=number)
    return tracks_to_msg([track._replace(size_m=np.array([0.6, 0.6, 1.7]))], Header()).objects[0]
