"""Detector `yolov5`: YOLOv5 checkpoints, and the networks in ONNX files."""
from ros_3d_bb.core.detection_pace import SIZES, sizes_for_range
from ros_3d_bb.detection.detector import Detector
from ros_3d_bb.detection.yolov5.backends import open_detector


class NetworkPeople(Detector):
    """A NetworkDetector whose DetectionParams and input size can be changed."""

    def __init__(self, events, params, detection, running):
        super(NetworkPeople, self).__init__(events, params, detection, running)
        self._network = open_detector(params.weights, detection, running,
                                      lambda line: events.warn('remarks of the detector', line))
        self.names = self._network.names
        self.description = '%s on %s' % (params.weights, self._network.description)

    def reconfigure(self, params, detection, running):
        self._network = self._network.with_params(detection)
        super(NetworkPeople, self).reconfigure(params, detection, running)

    def sizes(self, camera):
        detection, _running = self._own
        if detection.image_size or self._network.has_fixed_size:
            return (self._network.input_px,)
        if camera is None:
            return SIZES
        return sizes_for_range(detection.detection_range, camera.fx, max(camera.width, camera.height))

    def detect(self, image):
        network = self._network
        if self.size:
            network = network.with_params(self._own[0]._replace(image_size=self.size))
        return network.detect(image)
