"""What every 2D detector offers: boxes, a picture of them, and a switch."""
import contextlib
import time

import rospy
from sensor_msgs.msg import Image
from std_msgs.msg import Int32MultiArray
from std_srvs.srv import SetBool, SetBoolResponse

from ros_3d_bb.conversions.image_msgs import fill_image
from ros_3d_bb.conversions.perception_msgs import boxes2d_to_msg
from ros_3d_bb.visualization.image_overlay import draw_boxes

SILENT_S = 5.0  # an image waits so long for its search to end


class BoxesOutput(object):
    """What a detector found, for bbox3d_node and for people.

    Publishes
    ---------
    yolo_bounding_box : std_msgs/Int32MultiArray
        x1, y1, x2, y2 of each person, pixels; stamp and frame of the image in `layout.dim[0].label`.
    yolo_result_out : sensor_msgs/Image
        The colour image with the 2D boxes, while somebody subscribes.
    """

    def __init__(self, publish_empty):
        self._publish_empty = publish_empty
        self._boxes_pub = rospy.Publisher('yolo_bounding_box', Int32MultiArray, queue_size=10)
        self._image_pub = rospy.Publisher('yolo_result_out', Image, queue_size=1)

    def publish(self, header, image, found, names):
        """The detections in an RGB image with a header; `names` of the classes by number."""
        if len(found.boxes) or self._publish_empty:
            self._boxes_pub.publish(boxes2d_to_msg(found.boxes, header))
        if self._image_pub.get_num_connections():
            labels = ['%s %.2f' % (names[number], score) for number, score in zip(found.classes, found.scores)]
            drawn = draw_boxes(image.copy(), found.boxes, labels)
            self._image_pub.publish(fill_image(Image(header=header), drawn, 'rgb8'))


class Switch(object):
    """Whether the detector works.

    The diagnostics say so, and complain where an image was handed over and no search ends.

    Services
    --------
    ~enable : std_srvs/SetBool
        Pauses the detector, and lets it go on.
    """

    def __init__(self, on, diagnostics):
        self.on = on
        self._waits_since_s = None  # the oldest image since a search ended
        diagnostics.show('detector', lambda: 'working' if self.on else 'paused')
        diagnostics.check(self._faults)
        rospy.Service('~enable', SetBool, self._on_request)

    def offered(self):
        """An image is handed over to be searched."""
        if self._waits_since_s is None:
            self._waits_since_s = time.monotonic()

    @contextlib.contextmanager
    def searching(self):
        """Around a search. Whatever comes of it, boxes, no floor or a refused image, the detector is at work."""
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
