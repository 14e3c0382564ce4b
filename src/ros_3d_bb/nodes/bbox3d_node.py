"""ROS node that estimates 3D bounding boxes from 2D bounding boxes and the depth image with the same stamp."""
import rospy
from sensor_msgs.msg import CameraInfo, Image
from std_msgs.msg import Int32MultiArray

from ros_3d_bb.camera.alignment import ALIGN, frames_fault, intrinsics_fault
from ros_3d_bb.conversions.camera_msgs import (COLOR_TOPIC, DEPTH_TOPIC, INFO_TOPICS, RAW, info_of_images,
                                               info_topic_beside, uncompressed)
from ros_3d_bb.conversions.image_msgs import fill_image, imgmsg_to_rgb
from ros_3d_bb.conversions.perception_msgs import BOXES3D_TOPIC, BOXES_TOPIC, camera_from_msg, stamp_of
from ros_3d_bb.core.latest_worker import NewestWorker
from ros_3d_bb.core.object_classes import described
from ros_3d_bb.core.time_sync import NS, MessageCache
from ros_3d_bb.msg import BoundingBox3DArray
from ros_3d_bb.nodes.common.diagnostics import Diagnostics
from ros_3d_bb.nodes.common.master import patient_master
from ros_3d_bb.nodes.common.reconfigure_server import ReconfigureServer
from ros_3d_bb.nodes.common.rgbd_inputs import RgbdInputs
from ros_3d_bb.nodes.common.startup import Part, read_params
from ros_3d_bb.nodes.common.subscribers import KEPT_AT_ONCE, subscribe, subscribe_camera_info
from ros_3d_bb.pipeline.estimation_stage import Bbox3dParams, EstimationStage
from ros_3d_bb.visualization.image_overlay import depth_to_grey, draw_boxes, draw_samples


class Bbox3dNode(object):
    """Estimate 3D boxes from 2D boxes and depth images.

    Each array of 2D boxes is paired with the depth image of the same stamp, regardless of the detector's latency.
    Parameters: config/bbox3d.yaml; some can be changed at run time.

    Subscribes
    ----------
    yolo_bounding_box : std_msgs/Int32MultiArray
        2D boxes.

    Publishes
    ---------
    ros_3d_bb/bb_3d : ros_3d_bb/BoundingBox3DArray
        3D boxes in the optical frame of the camera, with the stamp of the depth image.
    """

    def __init__(self, part=Part()):
        self.params, = params, = read_params(Bbox3dParams, namespace=part.namespace)
        self._diagnostics = Diagnostics(part)
        self._next_stage = part.next_stage
        self._stage = EstimationStage(params, self._diagnostics)
        self._boxes_pub = rospy.Publisher(BOXES3D_TOPIC, BoundingBox3DArray, queue_size=10)
        self._images = SampleImages(params, self._stage, self._diagnostics)
        self._inputs = part.inputs or RgbdInputs(params, self._diagnostics, part.transforms,
                                                 cache_s=params.cache_length, assumed_delay_s=params.assumed_delay)
        self._inputs.pipeline.connect_estimator(self._stage.estimate, self._diagnostics, self._publish)
        if params.depth != RAW:
            self._diagnostics.check(DepthCameraCheck(with_frames=not params.frame_id).faults)
        self._source = self._inputs.pipeline.source
        self.on_boxes = self._inputs.receiver('2D boxes', self._source.add_boxes)
        if part.subscribes:
            subscribe(BOXES_TOPIC, Int32MultiArray, self.on_boxes)
        ReconfigureServer([params], self._reconfigure, part.namespace)

    def _reconfigure(self, params):
        with self._inputs.lock:
            self._stage.reconfigure(params)
            self._source.set_assumed_delay(params.assumed_delay)
            self._images.depth_range_m = params.depth_image_range

    def _publish(self, message, boxes3d, frame, depth_msg):
        self._boxes_pub.publish(message)
        self._diagnostics.record_latency(message.header.stamp)
        if self._next_stage is not None:
            self._next_stage(message, depth_msg)
        self._images.publish(message.header, frame.received.depth, boxes3d)


class DepthCameraCheck(object):
    """Check that the depth images are aligned to the colour images.

    `with_frames` states whether the frame names are reliable. The topics stay subscribed: on a new subscription, rospy
    would wait for an unreachable master and block all other requests to it.

    Subscribes
    ----------
    camera/aligned_depth_to_color/camera_info : sensor_msgs/CameraInfo
        Calibration of the depth image, in the namespace of its topic (remapped or not). It is compared with that of
        the colour camera.
    """

    def __init__(self, with_frames):
        self._with_frames, depth_topic = with_frames, rospy.resolve_name(DEPTH_TOPIC)
        self._newest = newest = {}  # depth_frame, and the CameraInfo color and depth
        subscribe(DEPTH_TOPIC, Image, lambda message: newest.update(depth_frame=message.header.frame_id), KEPT_AT_ONCE)
        subscribe_camera_info(INFO_TOPICS[0], DEPTH_TOPIC, lambda message: newest.update(color=message))
        rospy.Subscriber(info_topic_beside(depth_topic), CameraInfo,
                         lambda message: newest.update(depth=info_of_images(message, depth_topic)), queue_size=1)

    def faults(self):
        """Yield (event, sentence) for each current fault. Called once per second."""
        color, depth, fault = self._newest.get('color'), self._newest.get('depth'), ''
        if color is not None and self._with_frames:
            fault = frames_fault(color.header.frame_id, self._newest.get('depth_frame', ''))
        if color is not None and depth is not None and not fault:
            try:
                fault = intrinsics_fault(camera_from_msg(color), camera_from_msg(depth))
            except ValueError:  # the node reports colour; many drivers leave depth's K empty
                pass
        if fault:
            yield 'alignment', ('depth is not aligned to colour, or has a wrong header or camera_info: %s; positions '
                                'may be wrong; rosrun ros_3d_bb doctor compares the images; if they disagree: %s'
                                % (fault, ALIGN))


class SampleImages(object):
    """Publish the images and depth samples from which 3D boxes were estimated.

    Depth from `depth_range_m` on is drawn as black.

    Subscribes
    ----------
    camera/color/image_raw : sensor_msgs/Image
        Colour image; subscribed only while ros_3d_bb/raw or ros_3d_bb/color has subscribers.

    Publishes
    ---------
    ros_3d_bb/raw : sensor_msgs/Image
        Colour image of the boxes; published only if there are subscribers.
    ros_3d_bb/color : sensor_msgs/Image
        Colour image with boxes and depth samples (thesis Fig. 3.5); published only if there are subscribers.
    ros_3d_bb/depth : sensor_msgs/Image
        Depth image in grey; published only if there are subscribers.
    """

    def __init__(self, params, stage, diagnostics):
        self._stage, self._diagnostics, self.depth_range_m = stage, diagnostics, params.depth_image_range
        self._raw_pub, self._color_pub, self._depth_pub = (
            rospy.Publisher('ros_3d_bb/' + name, Image, queue_size=1) for name in ('raw', 'color', 'depth'))
        self._cache_ns = int(params.cache_length * NS)
        self._colors, self._unsubscribe = MessageCache(self._cache_ns), None
        # In a separate thread, because an unresponsive master must not block the 3D boxes.
        self._subscription = NewestWorker(self._subscribe, self._on_error)

    def publish(self, header, depth, boxes):
        """Publish the debug images of the 3D boxes in a received depth image on the topics that have subscribers."""
        needs_raw, needs_color = self._raw_pub.get_num_connections() > 0, self._color_pub.get_num_connections() > 0
        needs_depth = self._depth_pub.get_num_connections() > 0
        if (needs_raw or needs_color) != (self._unsubscribe is not None):
            self._subscription.offer(needs_raw or needs_color)
        if not (needs_raw or needs_color or needs_depth):
            return
        if needs_depth:
            grey = depth_to_grey(depth, self.depth_range_m)
            self._depth_pub.publish(fill_image(Image(header=header), grey, 'mono8'))
        color = self._colors.nearest(header.stamp.to_nsec())
        if color is None:
            return
        with self._diagnostics.rejecting('colour images'):  # an unusable one does not affect the 3D boxes
            color_msg = uncompressed(color.value)
            if needs_raw:
                self._raw_pub.publish(color_msg)
            if needs_color:
                image = imgmsg_to_rgb(color_msg).copy()
                for box in boxes:
                    draw_boxes(image, [box.rect_px], [described(box.label, '%.2f m' % box.center_m[2])])
                for box in boxes:
                    draw_samples(image, box.rect_px, self._stage.estimator.sample(depth, box.rect_px))
                self._color_pub.publish(fill_image(Image(header=header), image, 'rgb8'))

    def _subscribe(self, wanted):
        patient_master().getPid()  # raises if there is no master, for which rospy would hold a lock, even at Ctrl-C
        if wanted and self._unsubscribe is None:
            self._unsubscribe = subscribe(COLOR_TOPIC, Image, self._on_color, KEPT_AT_ONCE)
        elif not wanted and self._unsubscribe is not None:
            self._unsubscribe()
            self._unsubscribe, self._colors = None, MessageCache(self._cache_ns)

    def _on_error(self, error):
        self._diagnostics.warn('colour images not subscribed', 'the ROS master does not respond (%s): the subscription '
                               'of colour images for ros_3d_bb/color and raw is unchanged; trying again' % error)

    def _on_color(self, message):
        with self._diagnostics.rejecting('colour images'):
            self._colors.add(stamp_of(message), 0, message)
