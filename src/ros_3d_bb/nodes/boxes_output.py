"""What every 2D detector offers: boxes, a picture of them, and a switch."""
import rospy
from sensor_msgs.msg import Image
from std_msgs.msg import Int32MultiArray
from std_srvs.srv import SetBool, SetBoolResponse

from ros_3d_bb.images import fill_image
from ros_3d_bb.messages import boxes2d_to_message
from ros_3d_bb.overlay import draw_boxes


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
            self._boxes_pub.publish(boxes2d_to_message(found.boxes, header))
        if self._image_pub.get_num_connections():
            labels = ['%s %.2f' % (names[number], score) for number, score in zip(found.classes, found.scores)]
            drawn = draw_boxes(image.copy(), found.boxes, labels)
            self._image_pub.publish(fill_image(Image(header=header), drawn, 'rgb8'))


class Switch(object):
    """Whether the detector works.

    Services
    --------
    ~enable : std_srvs/SetBool
        Pauses the detector, and lets it go on.
    """

    def __init__(self, on):
        self.on = on
        rospy.Service('~enable', SetBool, self._on_request)

    def _on_request(self, request):
        self.on = request.data
        return SetBoolResponse(True, 'detector %s' % ('enabled' if request.data else 'paused'))
