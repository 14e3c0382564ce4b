"""Estimation stage: 3D boxes from frames and 2D boxes, shared by bbox3d_node and the pipeline in one process."""
import functools
import itertools
from collections import Counter, deque
from typing import Any, Deque, Dict, Iterable, List, NamedTuple, Optional

import numpy as np

from ros_3d_bb.camera.images import RgbdFrame, turned_rotation
from ros_3d_bb.core.boxes2d import Boxes2D
from ros_3d_bb.core.event_counter import EventCounter
from ros_3d_bb.core.object_classes import PERSON, PERSON_CLASS, read_object_classes
from ros_3d_bb.core.params import (CLASSES_FILE, DEPTH, DEPTH_SCALE, IMAGE_ROTATION, LARGEST, STAMP_TOLERANCE, Param,
                                   parameters)
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.estimation.appearance import appearance_of
from ros_3d_bb.estimation.box3d import Box3D, Rejected
from ros_3d_bb.estimation.box3d_estimator import estimate_boxes, estimator_named, level_rotation
from ros_3d_bb.estimation.error_model import corrected_boxes, error_model_of_param

APPEARANCE_NS = NS // 10  # chosen: at 30 Hz, colours would take nearly as long as positions (0.25 of 0.31 ms a person)
# Check of the scale of depth images.
LATEST_PEOPLE = 20  # people that must agree
LEAST_SUPPORT = 0.3  # boxes with less are often those of other objects
LEAST_ASPECT = 2.5  # height / width of the 2D box of a person who stands; less for seated or hidden people
HEIGHTS_M = (0.8, 2.4)  # plausible: a child below a camera whose tilt of 45 degrees is unknown, and a tall adult
# 0.2: 5000 units per metre, as in TUM RGB-D; 0.25: 4000, of a RealSense L515
COMMON_FACTORS = np.array([0.001, 0.01, 0.1, 0.2, 0.25, 5, 10, 100, 1000])
COMMON_HEIGHTS_M = (1.3, 1.95)  # with a common factor: adults, who measure less if they are partly hidden; chosen
# A camera that is fixed to the robot has the same tilt in each image.
_level_rotation = functools.lru_cache(maxsize=16)(level_rotation)


@parameters()
class Bbox3dParams(NamedTuple):
    estimator: str = Param(
        'foreground', 'How a position is estimated from the depth in a box. foreground: from the nearest layer of '
        'depth that is large enough to be the person, whatever is behind them. median: as in the thesis, the median '
        'of the sampled points along each axis, background included.', choices=('foreground', 'median'), live=True)
    stride: int = Param(
        20, 'Distance between the depth samples of the estimator median; 20 in the thesis.', 'pixels',
        limits=(1, LARGEST), live=(1, 100))
    error_model: str = Param('')
    depth: str = DEPTH
    depth_scale: float = DEPTH_SCALE
    frame_id: str = Param('')
    cache_length: float = Param(
        1.0, 'How long depth images wait for their boxes, and boxes for their depth image. More than the detector '
        'ever takes.', 's')
    stamp_tolerance: float = STAMP_TOLERANCE
    floor_frame: str = Param('base_link')
    image_rotation: str = IMAGE_ROTATION
    classes_file: str = CLASSES_FILE
    assumed_delay: float = Param(
        0.05, 'Processing time of the detector, used where its boxes have no stamp.', 's', live=(0, 1))
    depth_image_range: float = Param(
        6.0, 'Depth that is drawn black in the grey image on ros_3d_bb/depth.', 'm', limits=(0.1, 10000), live=(1, 20))


class EstimationStage(object):
    """Estimate the 3D boxes of frames, and correct them by an error model. `events` counts rejected boxes.

    Raises ValueError if one of the `params`, Bbox3dParams, is invalid.
    """

    def __init__(self, params: Bbox3dParams, events: EventCounter) -> None:
        self._events, self._scale_check, self._colored_ns = events, ScaleCheck(), -APPEARANCE_NS
        self._classes = read_object_classes(params.classes_file)
        self._error_model = error_model_of_param(params.error_model)
        self.reconfigure(params)

    def reconfigure(self, params: Bbox3dParams) -> None:
        """Use another estimator or stride for the next boxes. If invalid, raise ValueError and keep the old one."""
        estimator = estimator_named(params.estimator, params.stride, self._classes)
        if self._error_model is not None:
            self._error_model.check_estimator(params.estimator)
        self.estimator = estimator

    def estimate(self, frame: RgbdFrame, boxes2d: Boxes2D) -> List[Box3D]:
        """Estimate the 3D boxes of one image from its RgbdFrame and Boxes2D.

        A 2D box yields no 3D box if it is empty or reversed, is Rejected, or gives an implausible size.
        Returns a list of `box3d.Box3D`; like the 2D boxes, they belong to the image as received, and its optical frame.
        """
        usable = self._usable_boxes(boxes2d)
        rects_px = list(map(tuple, frame.upright_rects(usable.boxes).tolist()))
        estimates = estimate_boxes(frame.depth, rects_px, frame.camera, self.estimator, _level_rotation(frame.up),
                                   usable.labels)
        found, boxes3d = [], []
        counts: Dict[str, int] = Counter()
        for box, score in zip(estimates, usable.scores.tolist()):
            if isinstance(box, Rejected):
                counts[box.reason] += 1
                continue
            found.append(box)
            if box.is_plausible:
                boxes3d.append(box._replace(score=score))
            else:
                self._warn_of_size(_as_received(box, frame))
        factor = self._scale_check.factor(found)
        if factor is not None:
            self._warn_of_scale(factor, frame.depth_unit_m)
        boxes3d = self._with_appearance(boxes3d, frame)
        counts['boxes estimated'] = len(boxes3d)
        boxes3d = corrected_boxes(boxes3d, self._error_model, abs(frame.stamp_ns - frame.depth_stamp_ns) / NS)
        if self._error_model is not None and boxes3d:
            outside = [box for box in boxes3d if self._error_model.distance_outside(box.center_m[0], box.center_m[2])]
            counts['boxes outside of the measured range'] = len(outside)
        counts['images estimated'] = 1
        self._events.count_all(counts)
        return [_as_received(box, frame) for box in boxes3d] if frame.turns else boxes3d

    def _with_appearance(self, boxes3d: List[Box3D], frame: RgbdFrame) -> List[Box3D]:
        """The boxes with the colours of people, of some images only: clothes do not change."""
        if frame.color is None or abs(frame.stamp_ns - self._colored_ns) < APPEARANCE_NS:
            return boxes3d
        self._colored_ns = frame.stamp_ns
        return [box._replace(appearance=appearance_of(box, frame.color, frame.depth, frame.camera))
                if box.label == PERSON else box for box in boxes3d]

    def _warn_of_size(self, box: Box3D) -> None:
        self._events.warn('boxes of impossible size', '2D box (%d, %d, %d, %d) gives a 3D box %.3g m wide and %.3g m '
                          'high at %.3g m; less than %g and %g m expected; the others in this image are used'
                          % (box.rect_px + (box.size_m[0], box.size_m[1], box.center_m[2]) + box.largest_m))

    def _warn_of_scale(self, factor: float, unit_m: float) -> None:
        self._events.warn('depth of a wrong scale', 'people of impossible height: depth must be multiplied by %g; '
                          'set ~depth_scale: %g (now %g); 3D boxes are wrong or missing until then'
                          % (factor, factor * unit_m, unit_m))

    def _usable_boxes(self, boxes2d: Boxes2D) -> Boxes2D:
        boxes = boxes2d.boxes
        is_usable = (boxes[:, 0] < boxes[:, 2]) & (boxes[:, 1] < boxes[:, 3])
        for rect_px in boxes[~is_usable].tolist():
            self._events.warn('boxes rejected', '2D box (%d, %d, %d, %d) is empty or reversed: x1 < x2 and y1 < y2 '
                              'expected; the others in this image are used' % tuple(rect_px))
        return boxes2d._replace(boxes=boxes[is_usable], labels=tuple(itertools.compress(boxes2d.labels, is_usable)),
                                scores=boxes2d.scores[is_usable])


def _as_received(box: Box3D, frame: RgbdFrame) -> Box3D:
    """Convert a Box3D of the upright image to the optical frame and the pixels of the image as received."""
    received_from_upright = turned_rotation(frame.turns).T
    (rect_px,) = frame.received_rects(np.array([box.rect_px])).tolist()
    size_m, largest_m = box.size_m, box.largest_m
    edges: Any = box.truncated_edges
    if frame.turns % 2:
        size_m, largest_m = size_m[[1, 0, 0]], largest_m[::-1]
    covariance_m2 = box.covariance_m2
    if covariance_m2 is not None:
        covariance_m2 = received_from_upright.dot(covariance_m2).dot(received_from_upright.T)
    return box._replace(center_m=received_from_upright.dot(box.center_m), size_m=size_m, rect_px=tuple(rect_px),
                        truncated_edges=edges[frame.turns:] + edges[:frame.turns],
                        covariance_m2=covariance_m2, largest_m=largest_m)


class ScaleCheck(object):
    """Checks the scale of depth images by the heights of the latest people. People who are partly hidden, truncated or
    not standing are not counted, nor are other objects.

    Three quarters of the heights must be too large, or too small.
    """

    def __init__(self) -> None:
        self._heights_m: Deque[float] = deque(maxlen=LATEST_PEOPLE)

    def factor(self, boxes: Iterable[Box3D]) -> Optional[float]:
        """Add the `Box3D`s of one image, plausible or not.

        Returns
        -------
        float or None
            Factor by which depth must be multiplied to give people the usual height; a common factor if one is near.
            None if the heights are possible or too few. After a factor, new people are collected.
        """
        for box in boxes:
            if _shows_standing_person(box):
                self._heights_m.append(float(box.size_m[1]))
        if len(self._heights_m) < LATEST_PEOPLE:
            return None
        lower_m, median_m, upper_m = sorted(self._heights_m)[LATEST_PEOPLE // 4::LATEST_PEOPLE // 4]
        if upper_m >= HEIGHTS_M[0] and lower_m <= HEIGHTS_M[1]:
            return None
        self._heights_m.clear()
        factor = PERSON_CLASS.height / median_m
        common = float(COMMON_FACTORS[np.abs(np.log(COMMON_FACTORS / factor)).argmin()])
        is_common = COMMON_HEIGHTS_M[0] <= common * median_m <= COMMON_HEIGHTS_M[1]
        return common if is_common else float('%.2g' % factor)


def _shows_standing_person(box: Box3D) -> bool:
    x1, y1, x2, y2 = box.rect_px
    is_supported = box.support >= LEAST_SUPPORT or box.size_m[1] > HEIGHTS_M[1]  # a giant is deeper than a body's layer
    return box.label == PERSON and not box.truncated and is_supported and y2 - y1 >= LEAST_ASPECT * (x2 - x1)
