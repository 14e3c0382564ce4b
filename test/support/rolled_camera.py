"""A simulated camera without tf whose right side is lower, and the messages of its images."""
import numpy as np
from std_msgs.msg import Header

from ros_3d_bb.camera.depth_image import DepthImage
from ros_3d_bb.conversions.camera_msgs import START_NS, CameraFrame, image_messages_of
from ros_3d_bb.conversions.perception_msgs import time_from
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb_lab.simulation.scenario import scenario_from
from ros_3d_bb_lab.simulation.simulator import Simulator

HEIGHT_M, TILT_RAD, ROLL_RAD, FRAME = 1.2, 0.1, np.radians(12), 'camera_color_optical_frame'
PEOPLE = [{'start': [2.6, -0.5], 'moves': [{'to': [3.4, 0.9]}]}, {'start': [3.6, 0.8], 'moves': [{'to': [3.4, -0.9]}]},
          {'start': [4.4, -0.8], 'facing': 2.0}]


class RolledSimulator(Simulator):
    """Three people for three seconds at 10 Hz. The map is the frame on the floor below the camera."""

    def __init__(self):
        super(RolledSimulator, self).__init__(scenario_from({
            'duration': 3.0, 'rate': 10.0, 'people': PEOPLE,
            'robot': {'mount': [0.0, 0.0, HEIGHT_M - 0.065], 'pitch': TILT_RAD}}))

    def poses(self, state, camera=0):
        """As of Simulator, rolled."""
        poses, rolled = super(RolledSimulator, self).poses(state, camera), np.eye(4)
        rolled[:3, :3] = [[np.cos(ROLL_RAD), -np.sin(ROLL_RAD), 0], [np.sin(ROLL_RAD), np.cos(ROLL_RAD), 0], [0, 0, 1]]
        return poses._replace(base_from_camera=poses.base_from_camera.dot(rolled))

    def messages(self, frame, start_ns=START_NS):
        """Stamp in nanoseconds of a frame, and its [(topic, message)]."""
        stamp_ns = start_ns + int(frame.time_s * NS)
        return stamp_ns, list(image_messages_of(CameraFrame(
            Header(stamp=time_from(stamp_ns), frame_id=FRAME), self.camera, frame.color,
            DepthImage(frame.depth_mm, 0.001), ())))
