"""Input and output types of the tracker. Positions and sizes are in the fixed frame (z up), metres."""
import math
from typing import Any, Callable, Dict, List, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from ros_3d_bb.camera.camera_model import transform_points
from ros_3d_bb.camera.images import quarter_turns
from ros_3d_bb.core.object_classes import PERSON, ObjectClasses

VISIBLE, OCCLUDED, OUT_OF_VIEW = 0, 1, 2
NOT_DETECTED = -1  # index of the box of an object that was not detected
# Chosen.
NEARER_M = 0.25  # an occluding person is at least this much nearer to the camera than an occluded one
MOST_STEPS = 1000  # maximum number of prediction steps, to limit memory
VERTICAL = 0.02  # upper bound of the horizontal part of the optical axis of a camera that points straight up or down


class Detection(NamedTuple):
    """One object in one image: centre (3,) and extent (3,), x = y = width, z = height; sequences or arrays of float.

    `covariance_m2` (3, 3) is the covariance of the centre, None if unknown. `truncated_edges` states whether the image
    border truncates the object at the left, top, right and bottom, as seen by a camera held upright. `support` is the
    share 0..1 of the depth in its 2D box that belongs to the object. `label` is the class name, `score` that of the
    detector, 0..1, 0 if unknown, and `index` the index of the object's box among those of the image. A detection that
    `is_ignored` starts no track.
    """

    position_m: Sequence[float]
    size_m: Sequence[float]
    covariance_m2: Optional[Sequence[Sequence[float]]] = None
    truncated_edges: Tuple[bool, bool, bool, bool] = (False, False, False, False)
    support: float = 1.0
    label: str = PERSON
    score: float = 0.0
    index: int = NOT_DETECTED  # type: ignore[assignment]  # tuple.index is never used
    appearance: Optional[Tuple[float, ...]] = None
    is_ignored: bool = False


def detections_from_boxes(boxes: Dict[int, Any], fixed_from_camera: np.ndarray,
                          classes: ObjectClasses = ObjectClasses()) -> List[Detection]:
    """Convert the boxes of an image to a list of Detection in the fixed frame.

    The cylinders are upright in the fixed frame, independent of which edge of the image is up: for a camera mounted in
    portrait, width and height are swapped.

    Parameters
    ----------
    boxes : dict
        {index: `box3d.Box3D`}, where index is `Detection.index`.
    fixed_from_camera : numpy.ndarray, (4, 4)
        Pose of the camera's optical frame in the fixed frame.
    classes : object_classes.ObjectClasses
    """
    turns = quarter_turns(fixed_from_camera[2, :3])  # the z axis of the fixed frame points up
    rows, rotation = fixed_from_camera[:3].tolist(), fixed_from_camera[:3, :3]
    detections = []
    for index, box in boxes.items():
        (x, y, z), (width_m, height_m) = map(float, box.center_m), map(float, box.size_m[:2])
        if turns % 2:
            width_m, height_m = height_m, width_m
        position_m = tuple([of_x * x + of_y * y + of_z * z + shift_m for of_x, of_y, of_z, shift_m in rows])
        covariance_m2 = box.covariance_m2
        if covariance_m2 is not None:
            covariance_m2 = rotation.dot(covariance_m2).dot(rotation.T).tolist()
        detections.append(Detection(
            position_m, (width_m, width_m, height_m), covariance_m2,
            box.truncated_edges[-turns:] + box.truncated_edges[:-turns], box.support or 1.0,  # 0: unknown
            classes.standard_name(box.label), box.score, index, box.appearance))
    return detections


class CameraView(NamedTuple):
    """Pose of the camera of an image, (4, 4) from its optical frame to the fixed frame, and its field of view.

    `intrinsics` is None if unknown. `camera` identifies the camera. `depth_at` is None without a depth image; otherwise
    it is a function that takes points (k, 3) in the optical frame and returns the depths (k,) measured in their
    direction, metres, nan without valid depth. `measured_area` returns the part of the image (x1, y1, x2, y2) in which
    depth is measured; None: all of it.
    """

    fixed_from_camera: np.ndarray
    intrinsics: Any = None  # Camera or None
    camera: str = ''
    depth_at: Any = None  # Callable[[np.ndarray], np.ndarray] or None
    measured_area: Optional[Callable[[], Tuple[int, int, int, int]]] = None

    @property
    def ahead(self) -> np.ndarray:
        """Unit vector (2,) of the horizontal direction of the optical axis; of the upper edge of the image for a camera
        that points straight up or down."""
        (_right, up_x, x), (_right, up_y, y) = self.fixed_from_camera[:2, :3].tolist()
        if x * x + y * y < VERTICAL ** 2:
            x, y = -up_x, -up_y
        length = math.sqrt(x * x + y * y)
        return np.array((x / length, y / length))

    def bearings(self, positions_m: Any) -> Tuple[np.ndarray, np.ndarray]:
        """Horizontal distances (n,) of positions (n, 2 or 3) from the camera, metres, and their bearings (n,), radians:
        0 straight `ahead`, positive to the left.
        """
        ahead = self.ahead
        offsets = np.asarray(positions_m)[:, :2] - self.fixed_from_camera[:2, 3]
        bearings = np.arctan2(ahead[0] * offsets[:, 1] - ahead[1] * offsets[:, 0], offsets.dot(ahead))
        return np.hypot(offsets[:, 0], offsets[:, 1]), bearings

    def outline(self, range_m: float) -> np.ndarray:
        """Corners (3, 2) of the field of view in the plane: the camera, and the left and right edge at `range_m`."""
        (width, height), ahead = self.intrinsics[:2], self.ahead
        edges_px = (0, height / 2), (width, height / 2), (width / 2, 0), (width / 2, height)
        edges_m = transform_points(self.fixed_from_camera, self.intrinsics.deproject(edges_px, 1.0))
        _distances_m, bearings = self.bearings(edges_m)
        sides = [ahead.dot([[np.cos(bearing), np.sin(bearing)], [-np.sin(bearing), np.cos(bearing)]])
                 for bearing in (bearings.max(), bearings.min())]
        return self.fixed_from_camera[:2, 3] + range_m * np.vstack(([(0, 0)], sides))


class TrackedObject(NamedTuple):
    """State of one tracked object after an image.

    `prediction_m` (steps, 3) holds the positions after 1, 2, 3, ... times `prediction_step_s`. Stamps are nanoseconds.
    `covariance` (6, 6) is that of x, y, z and their velocities; `prediction_covariance_m2` (steps, 3, 3) that of the
    predicted positions. Both are None for trackers that do not estimate them. `label` is the class name, `score` the
    filtered score of the detector, 0..1, 0 if unknown, and `detection` the `Detection.index` in the newest image.
    """

    id: int
    position_m: np.ndarray
    size_m: np.ndarray
    velocity_mps: np.ndarray
    status: int
    moving: bool
    first_seen_ns: int
    last_seen_ns: int
    prediction_m: np.ndarray
    prediction_step_s: float
    covariance: Optional[np.ndarray] = None
    prediction_covariance_m2: Optional[np.ndarray] = None
    label: str = PERSON
    score: float = 0.0
    detection: int = NOT_DETECTED


def wrapped(angles: np.ndarray) -> np.ndarray:
    """Wrap angles to -pi..pi, radians."""
    return angles - 2 * np.pi * np.rint(angles / (2 * np.pi))


def prediction_times_s(time_s: float, step_s: float) -> np.ndarray:
    """Prediction times (steps,) after an image: multiples of `step_s` up to `time_s`, seconds."""
    return step_s * np.arange(1, int(round(time_s / step_s)) + 1)


def check_steps(time_s: float, step_s: float) -> None:
    """Raise ValueError if a prediction up to `time_s` in steps of `step_s`, seconds, is not possible."""
    if not step_s > 0:
        raise ValueError('prediction_step is %g; more than 0 expected' % step_s)
    if time_s / step_s > MOST_STEPS:
        raise ValueError('prediction_step is %g and prediction_time %g; at most %d steps expected'
                         % (step_s, time_s, MOST_STEPS))
