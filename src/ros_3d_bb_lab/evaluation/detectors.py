"""The detectors of the registry as functions of images, for benchmarks."""
import numpy as np

from ros_3d_bb.camera.images import RgbdFrame
from ros_3d_bb.core.event_counter import EventCounter
from ros_3d_bb.detection.boxes import Detections
from ros_3d_bb.pipeline.detectors import open_named, row_named, without_weights

NO_DETECTIONS = Detections(np.zeros((0, 4)), np.zeros(0), np.zeros(0, int))


def detector_of(name, camera):
    """A detector without weights as a function of a colour image, a DepthImage of the same Camera, and the transform
    (4, 4) to the camera from a frame on the floor (None: unknown). It returns Detections."""
    row = row_named(name)
    params, *own = row.defaults(name)
    detector = open_named(EventCounter(), params._replace(floor_height=0.0), *own)

    def detect(color, depth, camera_from_floor=None):
        frame = RgbdFrame(0, 0, '', camera, depth, depth.scale_m, color, camera_from_floor=camera_from_floor)
        return detector.detect(frame if row.uses_depth else color) or NO_DETECTIONS

    return detect


def weight_free_detectors(camera):
    return {name: detector_of(name, camera) for name in without_weights()}
