"""Interface of the detectors, and the parameters that all of them have."""
from typing import NamedTuple

from ros_3d_bb.core.params import DEPTH, DEPTH_SCALE, IMAGE_ROTATION, STAMP_TOLERANCE, Param, parameters

WITH_DEPTH = 'Detectors that use depth'  # section of parameters


@parameters('All detectors')
class DetectorParams(NamedTuple):
    """Parameters of detector_node, except those of one detector."""

    detector: str = Param('yolov5')
    weights: str = Param('')
    device: str = Param('auto')
    floor_frame: str = Param('base_link')
    depth: str = DEPTH
    frame_id: str = Param('')
    image_rotation: str = IMAGE_ROTATION
    enabled: bool = Param(True, 'Whether the detector runs from the start. The service ~enable changes it.')
    publish_empty: bool = Param(
        True, 'Whether an empty array is published where no people are detected, so that tracks age.')
    floor_height: float = Param(
        -0.065, 'Height of the floor in floor_frame. The default fits base_link of a Jackal.', 'm',
        limits=(-10000, 10000), live=(-1, 1), section=WITH_DEPTH)
    depth_scale: float = DEPTH_SCALE._replace(section=WITH_DEPTH)
    stamp_tolerance: float = STAMP_TOLERANCE._replace(section=WITH_DEPTH)


class Detector(object):
    """Base of the detectors. A subclass overrides `detect`, and what else differs.

    `events` is an EventCounter for warnings, `params` the DetectorParams, and `own` has an instance of each parameter
    class in the row of the detector in `pipeline.detectors.DETECTORS`. Raises ValueError if one is invalid.

    Attributes
    ----------
    names : sequence of str
        Names of the classes by number.
    description : str
        What the detector runs on, for the log.
    size : int
        Longer side of the image in which the next detection takes place, pixels; one of `sizes`.
    """

    names, description, size = ('person',), '', 0

    def __init__(self, events, params, *own):
        self._events, self._params, self._own = events, params, own

    def reconfigure(self, params, *own):
        """Use other parameters from the next image on. If they are invalid, raise ValueError and keep the old ones."""
        self._params, self._own = params, own

    def sizes(self, _camera):
        """Sizes to choose from for images of a Camera (None: unknown), increasing; (0,) if there is no choice."""
        return (0,)

    def detect(self, image):
        """Return the Detections (`boxes.Detections`) in an upright image.

        `image` is RGB, (height, width, 3), uint8, and the method may run in several threads at once. If the row has
        `uses_depth`, `image` is an RgbdFrame with `color`, `depth`, `camera` and `camera_from_floor`, and the result
        None means that there is none, so that no empty array is published.
        """
        raise NotImplementedError
