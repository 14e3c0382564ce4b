"""Tracking stages of cameras that look along x from one place, with boxes of a person 3 m ahead."""
from collections import namedtuple

import tf2_ros
from geometry_msgs.msg import Point, Vector3
from std_msgs.msg import Header

from ros_3d_bb.camera.camera_model import OPTICAL_ROTATION, transform_from
from ros_3d_bb.conversions.perception_msgs import time_from
from ros_3d_bb.core.event_counter import EventCounter
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.msg import BoundingBox3D, BoundingBox3DArray
from ros_3d_bb.pipeline.tracking_stage import TRACKING_PARAMS, TrackerNodeParams, TrackingStage

START_NS, PERIOD_NS = 1000 * NS, NS // 10
Result = namedtuple('Result', 'tracks header')  # arguments of `on_tracks`
PERIODS_NS = {'front': NS // 30, 'rear': NS // 25, 'left': NS // 10}  # of Play


class Transforms(object):
    """Lookup fails for the frames and stamps in `missing`. `while_waiting[frame]` is called in the next lookup."""

    def __init__(self):
        self.missing, self.while_waiting = set(), {}

    def lookup(self, _target, source, stamp):
        self.while_waiting.pop(source, lambda: None)()
        if {source, stamp.to_nsec()} & self.missing:
            raise tf2_ros.LookupException('no such frame')
        return transform_from((0, 0, 1), OPTICAL_ROTATION)

    def ancestors(self, frame):
        return [frame]


class Rig(TrackingStage):
    """A stage of some cameras; of a single one without names. Boxes arrive at `now_ns`. Without `camera_timeout`, each
    image has a result."""

    def __init__(self, *cameras, camera_timeout=0.0, transforms=None, **params):
        self.now_ns, self.transforms, self.events, self._results = 0, transforms or Transforms(), EventCounter(), []
        params.update(cameras=list(cameras), camera_timeout=camera_timeout)
        super().__init__(TrackerNodeParams(**params), [kind() for kind in TRACKING_PARAMS],
                         self.events, self.transforms, lambda *result: self._results.append(Result(*result)))

    @property
    def newest(self):
        return self._results[-1]

    def send(self, stamp_ns, camera='', frame_id=None, count=1, z=3.0):
        """Equal boxes of one image. Returns the Result, or None."""
        return self.send_boxes(boxes(stamp_ns, frame_id or camera or 'camera', [(0.0, 0.0, z)] * count), camera)

    def send_boxes(self, message, camera=''):
        self.add_boxes(message, self.now_ns, camera)
        return self._results.pop() if self._results else None


class Play(object):
    """Cameras that send boxes while time passes. `results` are (now_ns, camera, Result or None)."""

    def __init__(self, *cameras, periods_ns=PERIODS_NS):
        self.now_ns, self.results = 0, []
        self.cameras, self.ahead_ns, self._due_ns = set(cameras), 0, {camera: 0 for camera in cameras}
        self._periods_ns = periods_ns
        self.faults = {}  # by camera: a function that returns by how much its stamps are ahead
        self.rig = Rig(*sorted(self.cameras) if len(self.cameras) > 1 else [])
        self.transforms, self.counts = self.rig.transforms, self.rig.events.counts

    def run(self, seconds, cameras=None, count=1):
        end_ns = self.now_ns + int(seconds * NS)
        cameras = self.cameras if cameras is None else cameras
        self._due_ns = {camera: max(due_ns, self.now_ns) for camera, due_ns in self._due_ns.items()}
        while True:
            camera = min(cameras, key=lambda name: (self._due_ns[name], name), default=None)
            if camera is None or self._due_ns[camera] >= end_ns:
                break
            self.now_ns = self._due_ns[camera]
            self._due_ns[camera] += self._periods_ns[camera]
            self.send(camera, self.faults.get(camera, int)(), count)
        self.now_ns = end_ns
        return self

    def send(self, camera, ahead_ns=0, count=1):
        """One image, whose stamp is ahead by `ahead_ns`."""
        self.rig.now_ns, result = self.now_ns, None
        with self.rig.events.rejecting('boxes'):
            result = self.rig.send(START_NS + self.now_ns + self.ahead_ns + ahead_ns,
                                   camera if len(self.cameras) > 1 else '', camera, count=count)
        self.results.append((self.now_ns, camera, result))
        return result

    def lost(self, camera, since_ns=0):
        """Number of images of a camera without a result."""
        return sum(result is None for now_ns, name, result in self.results if name == camera and now_ns >= since_ns)

    @property
    def ids(self):
        return [track.id for track in [result for _now_ns, _camera, result in self.results if result][-1].tracks]


def boxes(stamp_ns, frame_id='camera', centers_m=((0.0, 0.0, 3.0),)):
    """A BoundingBox3DArray with boxes of people at positions (right, down, forward) in a camera."""
    message = BoundingBox3DArray(header=Header(stamp=time_from(stamp_ns), frame_id=frame_id))
    for center_m in centers_m:
        box = BoundingBox3D(size=Vector3(0.5, 1.7, 0.5))
        box.center.position, box.center.orientation.w = Point(*center_m), 1.0
        message.boxes.append(box)
    return message
