"""A Follower of some cameras that look at somebody from one place, and boxes for it."""
import tf2_ros
from std_msgs.msg import Header

from ros_3d_bb.camera.camera_model import OPTICAL_ROTATION, transform_from
from ros_3d_bb.conversions.perception_msgs import time_from
from ros_3d_bb.core.event_counter import EventCounter
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.msg import BoundingBox3D, BoundingBox3DArray
from ros_3d_bb.pipeline.tracking_stage import TRACKING_PARAMS, TrackerNodeParams, TrackingStage

START_NS, PERIOD_NS = 1000 * NS, NS // 10
PERIODS_NS = {'front': NS // 30, 'rear': NS // 25, 'left': NS // 10}  # of Play


class Transforms(object):
    """Cameras that look along x from one place; none for the frames in `missing`. By frame, `while_waiting` is called
    in the next wait for one.
    """

    def __init__(self):
        self.missing, self.while_waiting, self.jumps = set(), {}, 0

    def lookup(self, _target, source, _stamp):
        self.while_waiting.pop(source, lambda: None)()
        if source in self.missing:
            raise tf2_ros.LookupException('no such frame')
        return transform_from((0, 0, 1), OPTICAL_ROTATION)

    def go_back(self):
        self.jumps += 1


class Rig(object):
    """A Follower of two cameras, and boxes for it, which arrive at `now_ns`."""

    def __init__(self):
        self.now_ns = 0
        self.transforms, self.events = Transforms(), EventCounter()
        params = TrackerNodeParams(cameras=['front', 'rear'])
        self.follower = TrackingStage(params, [kind() for kind in TRACKING_PARAMS], self.events, self.transforms)

    def send(self, stamp_ns, camera, frame_id=None, count=1):
        return self.follower.add_boxes(boxes(stamp_ns, frame_id or camera, count), self.now_ns, camera)


class Play(object):
    """Cameras that send boxes of somebody while time passes. `answers` are (now_ns, camera, Followed or None)."""

    def __init__(self, *cameras, periods_ns=PERIODS_NS):
        self.events, self.transforms, self.now_ns, self.answers = EventCounter(), Transforms(), 0, []
        self.cameras, self.ahead_ns, self._due_ns = set(cameras), 0, {camera: 0 for camera in cameras}
        self._periods_ns = periods_ns
        self.faults = {}  # by camera: returns how far its stamps are ahead of what is right
        self.respawn()

    def respawn(self):
        """Go on with another Follower, as where tracker_node ends and is started again."""
        params = TrackerNodeParams(cameras=sorted(self.cameras) if len(self.cameras) > 1 else [])
        self.follower = TrackingStage(params, [kind() for kind in TRACKING_PARAMS], self.events, self.transforms)

    def run(self, seconds, cameras=None, count=1, lags_ns=None):
        """Let time pass. `lags_ns`: by camera, how long its boxes take."""
        end_ns = self.now_ns + int(seconds * NS)
        cameras = self.cameras if cameras is None else cameras
        self._due_ns = {camera: max(due_ns, self.now_ns) for camera, due_ns in self._due_ns.items()}
        while True:
            camera = min(cameras, key=lambda name: (self._due_ns[name], name), default=None)
            if camera is None or self._due_ns[camera] >= end_ns:
                break
            self.now_ns = self._due_ns[camera]
            self._due_ns[camera] += self._periods_ns[camera]
            self.send(camera, self.faults.get(camera, int)() - (lags_ns or {}).get(camera, 0), count)
        self.now_ns = end_ns
        return self

    def send(self, camera, ahead_ns=0, count=1):
        """One image; how far its stamp is ahead of what is right."""
        message = boxes(START_NS + self.now_ns + self.ahead_ns + ahead_ns, camera, count)
        followed = None
        with self.events.rejecting('boxes'):
            followed = self.follower.add_boxes(message, self.now_ns, camera if self.follower.cameras != ('',) else '')
        self.answers.append((self.now_ns, camera, followed))
        return followed

    def lost(self, camera, since_ns=0):
        """How many images of a camera had no answer."""
        return sum(followed is None for now_ns, name, followed in self.answers if name == camera and now_ns >= since_ns)

    @property
    def ids(self):
        """Of the tracks in the newest answer."""
        return [track.id for track in [followed for _now_ns, _camera, followed in self.answers if followed][-1].tracks]


def boxes(stamp_ns, frame_id, count=1):
    box = BoundingBox3D()
    box.center.position.z = 3.0
    box.size.x, box.size.y, box.size.z = 0.5, 1.7, 0.5
    return BoundingBox3DArray(header=Header(stamp=time_from(stamp_ns), frame_id=frame_id), boxes=[box] * count)
