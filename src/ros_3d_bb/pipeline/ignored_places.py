"""Where no track starts: ~ignored_areas and the map, both in the target frame, for people in the tracking frame."""
from typing import Any, Callable, Iterable, List, Sequence

import numpy as np
from nav_msgs.msg import OccupancyGrid

from ros_3d_bb.conversions.perception_msgs import occupied_from_msg
from ros_3d_bb.core.event_counter import EventCounter
from ros_3d_bb.pipeline.tracking_frame import ImagePose
from ros_3d_bb.tracking.ignored_areas import IgnoredAreas, OccupiedCells, polygons_from
from ros_3d_bb.tracking.types import Detection


class IgnoredPlaces(object):
    """Marks detections that start no track. `params` are TrackerNodeParams; raises ValueError if they are invalid."""

    def __init__(self, params: Any, events: EventCounter) -> None:
        self._events, self._target_frame, self._areas = events, params.target_frame, areas_of(params)

    @property
    def polygons_m(self) -> Sequence[np.ndarray]:
        """The polygons of ~ignored_areas, arrays (n, 2)."""
        return self._areas.polygons

    def use(self, areas: IgnoredAreas) -> bool:
        """Use other areas, with the same map. Returns whether they differ from those before."""
        before, self._areas = self._areas, areas._replace(occupied=self._areas.occupied)
        return areas.differs_from(before)

    def use_map(self, cells: OccupiedCells) -> bool:
        before, self._areas = self._areas, self._areas._replace(occupied=cells)
        return before.occupied is None

    def cells_of(self, message: OccupancyGrid) -> OccupiedCells:
        """The occupied cells of a nav_msgs/OccupancyGrid. Raises ValueError if it is not in the target frame."""
        if message.header.frame_id.lstrip('/') != self._target_frame:
            raise ValueError('its frame is %r, and that of the tracks %r; the same expected, and no cells are ignored'
                             % (message.header.frame_id, self._target_frame))
        return occupied_from_msg(message)

    def marked(self, detections: List[Detection], pose: ImagePose) -> List[Detection]:
        """Detections in the tracking frame, marked if they start no track."""
        areas = self._areas
        if not detections or not areas.polygons and areas.occupied is None:
            return detections
        camera_m = pose.target_from_camera[:2, 3]
        places_m = pose.in_target(np.array([detection.position_m for detection in detections]))
        detections = [detection._replace(is_ignored=areas.contains(place_m, camera_m))
                      for detection, place_m in zip(detections, places_m)]
        self._events.count('boxes in ignored areas', sum(detection.is_ignored for detection in detections))
        return detections

    def seen_from(self, poses: Iterable[ImagePose], newest: ImagePose) -> Callable[[Any], bool]:
        """Function that returns whether a place (x, y) of the tracking frame is ignored, given the poses of the cameras
        and the newest one."""
        areas, cameras_m = self._areas, [pose.target_from_camera[:2, 3] for pose in poses]

        def is_ignored(place_m: Any) -> bool:
            point_m, = newest.in_target(np.array([place_m + (0.0,)]))
            return any(areas.contains(point_m, camera_m) for camera_m in cameras_m)
        return is_ignored


def areas_of(params: Any) -> IgnoredAreas:
    """The IgnoredAreas of TrackerNodeParams, without a map. Raises ValueError if they are invalid."""
    return IgnoredAreas(polygons_from(params.ignored_areas), None, params.map_depth)
