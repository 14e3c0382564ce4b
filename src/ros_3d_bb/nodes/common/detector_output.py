"""Worker of the 2D detector nodes: it detects, publishes, and can be paused."""
import time

import rospy
from sensor_msgs.msg import Image
from std_msgs.msg import Int32MultiArray
from std_srvs.srv import SetBool, SetBoolResponse

from ros_3d_bb.conversions.image_msgs import fill_image
from ros_3d_bb.conversions.perception_msgs import detections2d_to_msg, stamp_of
from ros_3d_bb.core.detection_pace import DetectionPace
from ros_3d_bb.core.error_text import cause
from ros_3d_bb.core.latest_worker import NewestWorker
from ros_3d_bb.visualization.image_overlay import draw_boxes

SILENT_S = 5.0  # time without a completed detection after which a fault is reported


class DetectorWorker(object):
    """Detect objects in the newest images, and publish them for bbox3d_node and as an annotated image.

    Slow detections take place in every n-th image, as the attribute `pace`, a DetectionPace, decides.

    `params` has `enabled` and `publish_empty`. `detect(*images)` is called in a thread of its own. It returns the RGB
    image, its Detections, and what the next stage needs with them; or None if there is no result. `names` are those of
    the classes, `part` is the node's.

    Publishes
    ---------
    yolo_bounding_box : std_msgs/Int32MultiArray
        x1, y1, x2, y2 of each object, in pixels; stamp and frame of the image, and class and score of each object, are
        in `layout.dim[0].label`.
    yolo_result_out : sensor_msgs/Image
        Colour image with the 2D boxes; published only if there are subscribers.

    Services
    --------
    ~enable : std_srvs/SetBool
        Enables (true) or pauses (false) the detector.
    """

    def __init__(self, params, diagnostics, detect, names, part):
        self._publish_empty, self._diagnostics, self._detect, self._names = (
            params.publish_empty, diagnostics, detect, names)
        self._enabled, self._next_stage = params.enabled, part.next_stage
        self._waits_since_s = None  # arrival of the oldest image since the last completed detection
        self._boxes_pub = rospy.Publisher('yolo_bounding_box', Int32MultiArray, queue_size=10)
        self._image_pub = rospy.Publisher('yolo_result_out', Image, queue_size=1)
        self.pace = DetectionPace()
        self._worker = NewestWorker(self._work, self._on_error)
        rospy.on_shutdown(self._worker.stop)
        diagnostics.show('detector', lambda: 'working' if self._enabled else 'paused')
        diagnostics.show('images per detection', lambda: str(self.pace.interval))
        diagnostics.check(self._faults)
        rospy.Service(part.namespace + 'enable', SetBool, self._on_request)

    def offer(self, *images):
        """Detect objects in these images, of which the first is the colour image, unless newer ones arrive first."""
        if not self.pace.add_image(stamp_of(images[0])):
            self._diagnostics.count('images skipped for a steady rate')
            return
        if self._waits_since_s is None:
            self._waits_since_s = time.monotonic()
        if self._worker.offer(images):
            self._diagnostics.count('images skipped for a newer one')

    def _work(self, images):
        if not self._enabled:
            self._diagnostics.count('images while paused')
            return
        start_s = time.monotonic()
        try:
            with self._diagnostics.rejecting('images'):
                result = self._detect(*images)
                if result is not None:
                    self._publish(images[0].header, *result)
                self._keep_pace(time.monotonic() - start_s)
        finally:  # any outcome, such as a rejected image, shows that the detector works
            self._waits_since_s = None

    def _publish(self, header, image, detections, *for_next_stage):
        if len(detections.boxes) or self._publish_empty:
            message = detections2d_to_msg(detections, self._names, header, image.shape[1::-1])
            self._boxes_pub.publish(message)
            self._diagnostics.record_latency(header.stamp)
            if self._next_stage is not None:
                self._next_stage(message, *for_next_stage)
        else:
            self._diagnostics.record_latency(header.stamp)
        if self._image_pub.get_num_connections():
            labels = ['%s %.2f' % (self._names[number], score)
                      for number, score in zip(detections.classes, detections.scores)]
            drawn = draw_boxes(image.copy(), detections.boxes, labels)
            self._image_pub.publish(fill_image(Image(header=header), drawn, 'rgb8'))

    def _keep_pace(self, duration_s):
        if self.pace.add_detection(duration_s):
            size = ' with an input of %d pixels' % self.pace.size if self.pace.size else ''
            self._diagnostics.note('changes of image size or rate', 'now detecting in one of %d images%s, to keep '
                                   'up with the camera' % (self.pace.interval, size))

    def _on_error(self, error):
        self._diagnostics.warn('detections failed',
                               'the detector failed: %s; waiting for the next image' % cause(error))

    def _faults(self):
        since_s, now_s = self._waits_since_s, time.monotonic()
        if self._enabled and since_s is not None and now_s - since_s > SILENT_S:
            yield 'detector hangs', ('images arrive, but no detection has completed for %.0f s; the detector hangs or '
                                     'lacks CPU time' % (now_s - since_s))

    def _on_request(self, request):
        self._enabled, self._waits_since_s = request.data, None
        return SetBoolResponse(True, 'detector %s' % ('enabled' if request.data else 'paused'))
