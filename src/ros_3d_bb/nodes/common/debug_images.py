"""Debug images of bbox3d_node, generated only if there are subscribers."""
import rospy
from sensor_msgs.msg import Image

from ros_3d_bb.conversions.image_msgs import fill_image, imgmsg_to_rgb
from ros_3d_bb.conversions.perception_msgs import stamp_of
from ros_3d_bb.core.latest_worker import NewestWorker
from ros_3d_bb.core.time_sync import MessageCache
from ros_3d_bb.nodes.common.master import patient_master
from ros_3d_bb.nodes.common.subscribers import KEPT_AT_ONCE, subscribe
from ros_3d_bb.visualization.image_overlay import draw_boxes, draw_samples, depth_to_grey


class SampleImages(object):
    """Publish the images and depth samples from which 3D boxes were estimated.

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

    def __init__(self, cache_ns, sample, depth_range_m, diagnostics):
        self._diagnostics = diagnostics
        self._cache_ns = cache_ns
        self.reconfigure(sample, depth_range_m)
        self._raw_pub, self._color_pub, self._depth_pub = (
            rospy.Publisher('ros_3d_bb/' + name, Image, queue_size=1) for name in ('raw', 'color', 'depth'))
        self._colors, self._subscriber = None, None
        # In a separate thread, because an unresponsive master must not block the 3D boxes.
        self._tracking_stage = NewestWorker(self._follow, self._on_error)

    def reconfigure(self, sample, depth_range_m):
        """Set the sampling function and the depth (metres) drawn as black for the next images."""
        self._sample, self._depth_range_m = sample, depth_range_m

    def publish(self, header, depth, boxes):
        """Publish the debug images of one set of 3D boxes on the topics that have subscribers.

        An unusable colour image is rejected here, so that it does not affect the 3D boxes.
        """
        needs_raw, needs_color = self._raw_pub.get_num_connections() > 0, self._color_pub.get_num_connections() > 0
        if (needs_raw or needs_color) != (self._subscriber is not None):
            self._tracking_stage.offer(needs_raw or needs_color)
        if self._depth_pub.get_num_connections():
            grey = depth_to_grey(depth, self._depth_range_m)
            self._depth_pub.publish(fill_image(Image(header=header), grey, 'mono8'))
        colors = self._colors
        color = colors.nearest(header.stamp.to_nsec()) if colors is not None else None
        if color is None:
            return
        if needs_raw:
            self._raw_pub.publish(color.value)
        if needs_color:
            with self._diagnostics.rejecting('colour images'):
                drawn = self._drawn(color.value, depth, boxes)
                self._color_pub.publish(fill_image(Image(header=header), drawn, 'rgb8'))

    def _drawn(self, color_message, depth, boxes):
        image = imgmsg_to_rgb(color_message).copy()
        for box in boxes:
            draw_boxes(image, [box.rect_px], ['%.2f m' % box.center_m[2]])
        for box in boxes:
            draw_samples(image, box.rect_px, self._sample(depth, box.rect_px))
        return image

    def _follow(self, wanted):
        """Subscribe to colour images or unsubscribe from them."""
        patient_master().getPid()  # raises if there is no master, for which rospy would hold a lock, even at Ctrl-C
        if wanted and self._subscriber is None:
            self._colors = MessageCache(self._cache_ns)
            self._subscriber = subscribe('camera/color/image_raw', Image, self._on_color, KEPT_AT_ONCE)
        elif not wanted and self._subscriber is not None:
            self._subscriber.unregister()
            self._subscriber, self._colors = None, None

    def _on_error(self, error):
        self._diagnostics.warn('colour images not subscribed', 'the ROS master does not answer (%s): colour images are '
                               'subscribed, for those who look at them, or no more, when it does' % error)

    def _on_color(self, message):
        colors = self._colors
        if colors is None:
            return
        with self._diagnostics.rejecting('colour images'):
            colors.add(stamp_of(message), 0, message)
