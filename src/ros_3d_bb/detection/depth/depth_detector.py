"""Detector `depth`: people in frames of an RGB-D camera, without weights."""
import math

import numpy as np

from ros_3d_bb.detection.depth.detector import DepthPeople
from ros_3d_bb.detection.depth.ground_plane import camera_pose_above, floor_from_transform
from ros_3d_bb.detection.detector import Detector


class DepthDetector(Detector):
    """Detect people above the floor, which is that of ~floor_frame, or fitted to the depth image."""

    def __init__(self, events, params, people):
        super(DepthDetector, self).__init__(events, params, people)
        self._people = DepthPeople(people)

    def reconfigure(self, params, people):
        self._people.reconfigure(people)
        super(DepthDetector, self).reconfigure(params, people)

    def detect(self, frame):
        """Return the Detections in an RgbdFrame; None while the floor is unknown."""
        floor = self._known_floor(frame)
        detections = self._people.detect(frame.color, frame.depth, frame.camera, floor)
        if detections is None:
            self._events.warn('images without floor', 'tf gives no floor, and none is visible in the depth image; no '
                              'detection; waiting for the next image')
        elif floor is not None and self._people.floor is not floor:
            self._events.warn('floors contradicted', 'tf gives %s, and the depth image shows %s; the latter is used; '
                              'check the camera mount and ~floor_height'
                              % tuple(_described(camera_pose_above([used])) for used in (floor, self._people.floor)))
        return detections

    def _known_floor(self, frame):
        if frame.camera_from_floor is None or not frame.is_floor_known:
            return None
        raised = np.eye(4)
        raised[2, 3] = self._params.floor_height
        return floor_from_transform(frame.camera_from_floor.dot(raised))


def _described(pose):
    return 'a camera %.2f m above the floor, tilted by %.1f and rolled by %.1f degrees' % (
        pose.height_m, math.degrees(pose.tilt_rad), math.degrees(pose.roll_rad))
