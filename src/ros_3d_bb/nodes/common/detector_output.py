"""Common interface of the 2D detector nodes: published boxes and image, and the service that pauses them."""
import contextlib
import time

import rospy
from sensor_msgs.msg import Image
from std_msgs.msg import Int32MultiArray
from std_srvs.srv import SetBool, SetBoolResponse

from ros_3d_bb.conversions.image_msgs import fill_image
from ros_3d_bb.conversions.perception_msgs import boxes2d_to_msg
from ros_3d_bb.visualization.image_overlay import draw_boxes

SILENT_S = 5.0  # time without a completed detection after which a fault is reported


class BoxesOutput(object):
    """Publish detections for bbox3d_node and as an annotated image.

    Publishes
    ---------
    yolo_bounding_box : std_msgs/Int32MultiArray
        x1, y1, x2, y2 of each person, in pixels; stamp and frame of the image are in `layout.dim[0].label`.
    yolo_result_out : sensor_msgs/Image
        Colour image with the 2D boxes; published only if there are subscribers.
    """

    def __init__(self, publish_empty):
        self._publish_empty = publish_empty
        self._boxes_pub = rospy.Publisher('yolo_bounding_box', Int32MultiArray, queue_size=10)
        self._image_pub = rospy.Publisher('yolo_result_out', Image, queue_size=1)

    def publish(self, header, image, found, names):
        """Publish the detections in an RGB image with a header; `names` maps class indices to names."""
        if len(found.boxes) or self._publish_empty:
            self._boxes_pub.publish(boxes2d_to_msg(found.boxes, header))
        if self._image_pub.get_num_connections():
            labels = ['%s %.2f' % (names[number], score) for number, score in zip(found.classes, found.scores)]
            drawn = draw_boxes(image.copy(), found.boxes, labels)
            self._image_pub.publish(fill_image(Image(header=header), drawn, 'rgb8'))


class Switch(object):
    """State of the detector: enabled or paused.

    The state is shown in the diagnostics, with a warning if an image was accepted and no detection completes.

    Services
    --------
    ~enable : std_srvs/SetBool
        Enables (true) or pauses (false) the detector.
    """

    def __init__(self, on, diagnostics):
        self.on = on
        self._waits_since_s = None  # arrival of the oldest image since the last completed detection
        diagnostics.show('detector', lambda: 'working' if self.on else 'paused')
        diagnostics.check(self._faults)
        rospy.Service('~enable', SetBool, self._on_request)

    def offered(self):
        """Record that an image was passed to the detector."""
        if self._waits_since_s is None:
            self._waits_since_s = time.monotonic()

    @contextlib.contextmanager
    def searching(self):
        """Context manager for one detection. Any outcome (boxes, no floor, rejected image) shows that the detector
        is working.
        """
        try:
            yield
        finally:
            self._waits_since_s = None

    def _faults(self):
        since_s, now_s = self._waits_since_s, time.monotonic()
        if self.on and since_s is not None and now_s - since_s > SILENT_S:
            yield 'no answers', ('the detector is silent: images come, and none has been answered for %.0f s; it '
                                 'hangs or is starved of CPU' % (now_s - since_s))

    def _on_request(self, request):
        self.on = request.data
        self._waits_since_s = None
        return SetBoolResponse(True, 'detector %s' % ('enabled' if request.data else 'paused'))
