"""The node that finds people without a trained network's weights, in depth and colour."""
import threading
from typing import NamedTuple

import rospy
import tf2_ros
from sensor_msgs.msg import CameraInfo, Image

from ros_3d_bb.detection.bodies import DepthPeopleParams
from ros_3d_bb.detection.depth_people import DepthPeople
from ros_3d_bb.detection.floor import floor_from_transform
from ros_3d_bb.geometry import transform_from
from ros_3d_bb.images import depth_from, rgb_from
from ros_3d_bb.messages import camera_from_message, stamp_of
from ros_3d_bb.nodes.boxes_output import BoxesOutput, Switch
from ros_3d_bb.nodes.diagnostics import Diagnostics
from ros_3d_bb.nodes.startup import read_params, run_node
from ros_3d_bb.nodes.transforms import Transforms
from ros_3d_bb.nodes.transport import KEPT_AT_ONCE, subscribe
from ros_3d_bb.params import check_not_negative
from ros_3d_bb.stamped import NS, Pairing, arrival_clock_ns
from ros_3d_bb.worker import NewestWorker

CACHE_NS = NS  # how long images wait for each other
NAMES = ['person']


class DepthDetectorParams(NamedTuple):
    """See config/depth_detector.yaml."""

    floor_frame: str = 'base_link'
    floor_height: float = -0.065
    frame_id: str = ''
    stamp_tolerance: float = 0.005
    enabled: bool = True
    publish_empty: bool = True


class DepthDetectorNode(object):
    """Find people in depth and colour.

    Subscribes: camera/color/image_raw, camera/aligned_depth_to_color/image_raw, camera/color/camera_info, tf.
    Publishes: yolo_bounding_box; yolo_result_out while somebody subscribes. Services: ~enable (std_srvs/SetBool).
    Parameters: config/depth_detector.yaml.
    """

    def __init__(self):
        self._params, people = read_params(DepthDetectorParams, DepthPeopleParams)
        check_not_negative(self._params, 'stamp_tolerance')
        self._detector = DepthPeople(people)
        self._pairing = Pairing(CACHE_NS, int(self._params.stamp_tolerance * NS), 0)
        self._lock = threading.Lock()
        self._diagnostics = Diagnostics()
        self._transforms = Transforms(wait_s=0) if self._params.floor_frame else None
        self._output = BoxesOutput(self._params.publish_empty)
        self._worker = NewestWorker(self._search, self._on_error)
        rospy.on_shutdown(self._worker.stop)
        self._switch = Switch(self._params.enabled)
        subscribe('camera/color/camera_info', CameraInfo, self._on_camera_info, KEPT_AT_ONCE)
        subscribe('camera/aligned_depth_to_color/image_raw', Image, self._on_depth, KEPT_AT_ONCE)
        subscribe('camera/color/image_raw', Image, self._on_color)

    def _on_camera_info(self, message):
        with self._diagnostics.refusing('camera_info'), self._lock:
            camera = camera_from_message(message)
            self._offer(self._pairing.add_camera(message.header.stamp.to_nsec(), arrival_clock_ns(), camera))

    def _on_depth(self, message):
        with self._diagnostics.refusing('depth images'), self._lock:
            self._offer(self._pairing.add_depth(stamp_of(message), arrival_clock_ns(), message))

    def _on_color(self, message):
        with self._diagnostics.refusing('colour images'), self._lock:
            self._offer(self._pairing.add_boxes(stamp_of(message), arrival_clock_ns(), message))

    def _offer(self, pairs):
        """Hand colour images on whose depth image has come."""
        for frame, color in pairs:
            if frame is None:
                self._diagnostics.warn('colour images without depth', 'no depth image and camera_info with the stamp '
                                       '%.3f of the colour image came; waiting for the next' % (stamp_of(color) / NS))
            elif self._switch.on and self._worker.offer((frame, color)):
                self._diagnostics.count('images skipped for a newer one')

    def _search(self, pair):
        with self._diagnostics.refusing('images'):
            if self._switch.on:  # it may have been paused since the image came
                self._detect(*pair)

    def _detect(self, frame, color):
        image = rgb_from(color)
        camera_frame = self._params.frame_id or color.header.frame_id
        found = self._detector.detect(image, depth_from(frame.depth), frame.camera, self._floor(camera_frame))
        if found is None:
            self._diagnostics.warn('images without floor', 'no floor is known from tf nor seen in the depth image: '
                                   'nobody is looked for; waiting for the next image')
            return
        self._diagnostics.count('images searched')
        self._output.publish(color.header, image, found, NAMES)

    def _floor(self, camera_frame):
        """The floor where tf says it is; None where it does not, so that it is fitted.

        The newest transform serves: the camera stands still in the robot, and nothing has to be waited for.
        """
        if self._transforms is None:
            return None
        try:
            camera_from_base = self._transforms.lookup(camera_frame, self._params.floor_frame, rospy.Time(0))
        except tf2_ros.TransformException as error:
            self._diagnostics.warn('images without transform', 'no transform from %s to %s: %s; the floor is looked '
                                   'for in the depth image' % (self._params.floor_frame, camera_frame, error))
            return None
        base_from_floor = transform_from((0, 0, self._params.floor_height), (0, 0, 0, 1))
        return floor_from_transform(camera_from_base.dot(base_from_floor))

    def _on_error(self, error):
        self._diagnostics.warn('searches failed', 'the detector failed: %s; waiting for the next image' % error)


def main():
    """Run the node."""
    run_node('depth_detector_node', DepthDetectorNode)
