"""Registry of the detectors: nodes, bags, launch files, doctor and benchmarks choose from it by name.

A new detector is a subclass of `detection.detector.Detector` in a file of its own, and a row here.
"""
from typing import Any, Dict, List, NamedTuple, Tuple, Type

from ros_3d_bb.core.event_counter import EventCounter
from ros_3d_bb.core.params import nearest_name
from ros_3d_bb.detection.depth.depth_detector import DepthDetector
from ros_3d_bb.detection.depth.person_clusters import DepthPeopleParams
from ros_3d_bb.detection.detector import Detector, DetectorParams
from ros_3d_bb.detection.network_detector import DetectionParams
from ros_3d_bb.detection.yolov5.backends import RuntimeParams
from ros_3d_bb.detection.yolov5.network_people import NetworkPeople

NONE = 'none'  # another node, or the bag, has the 2D boxes


class Row(NamedTuple):
    """A detector: its subclass of `Detector`, and what it needs."""

    kind: Type[Detector]
    own: Tuple[Any, ...] = ()  # parameter classes, beside DetectorParams
    uses_depth: bool = False  # `detect` gets an RgbdFrame instead of a colour image
    suffixes: Tuple[str, ...] = ()  # of files of ~weights; none: no weights are needed
    for_bags: Dict[str, Any] = {}  # parameters with other defaults where images of a bag are processed in parallel

    def defaults(self, name: str) -> Tuple[Any, ...]:
        """Return the parameters for bags and benchmarks, an instance of each class."""
        params: List[Any] = [DetectorParams(detector=name)] + [kind() for kind in self.own]
        return tuple(each._replace(**{key: value for key, value in self.for_bags.items() if key in each._fields})
                     for each in params)


DETECTORS = {
    'yolov5': Row(NetworkPeople, (DetectionParams, RuntimeParams), suffixes=('.pt', '.onnx'),
                  for_bags={'device': 'cpu', 'threads': 1}),
    'depth': Row(DepthDetector, (DepthPeopleParams,), uses_depth=True)}


def row_named(name: str) -> Row:
    """Return the Row of a detector. Raises ValueError if there is none."""
    if name in DETECTORS:
        return DETECTORS[name]
    raise ValueError('parameter ~detector is %r; did you mean %s? Known: %s, or %s if another node publishes the 2D '
                     'boxes' % (name, nearest_name(str(name), DETECTORS), ', '.join(sorted(DETECTORS)), NONE))


def check_weights(params: DetectorParams) -> None:
    """Raise ValueError if the detector that DetectorParams name needs weights, and none are given."""
    suffixes = row_named(params.detector).suffixes
    if suffixes and not params.weights:
        raise ValueError('no weights given for the detector %s; set ~weights to the path of a file (%s) such as '
                         'yolov5n.pt, or ~detector to one that needs none: %s'
                         % (params.detector, ', '.join(suffixes), ', '.join(without_weights())))


def open_named(events: EventCounter, params: DetectorParams, *own: Any) -> Detector:
    """Return the Detector that DetectorParams name, with its own parameters. Raises ValueError."""
    check_weights(params)
    return row_named(params.detector).kind(events, params, *own)


def without_weights() -> List[str]:
    return [name for name, row in DETECTORS.items() if not row.suffixes]
