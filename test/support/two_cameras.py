"""A Follower of two cameras that look at somebody from one place, and boxes for it."""
import tf2_ros
from std_msgs.msg import Header

from ros_3d_bb.following import TRACKING_PARAMS, Follower, TrackerNodeParams
from ros_3d_bb.geometry import OPTICAL_ROTATION, transform_from
from ros_3d_bb.messages import time_from
from ros_3d_bb.msg import BoundingBox3D, BoundingBox3DArray
from ros_3d_bb.stamped import NS
from ros_3d_bb.tally import Tally

START_NS, PERIOD_NS = 1000 * NS, NS // 10


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
        self.transforms, self.tally = Transforms(), Tally()
        params = TrackerNodeParams(cameras=['front', 'rear'])
        self.follower = Follower(params, [kind() for kind in TRACKING_PARAMS], self.tally, self.transforms)

    def send(self, stamp_ns, camera, frame_id=None, count=1):
        return self.follower.add_boxes(boxes(stamp_ns, frame_id or camera, count), self.now_ns, camera)


def boxes(stamp_ns, frame_id, count=1):
    box = BoundingBox3D()
    box.center.position.z = 3.0
    box.size.x, box.size.y, box.size.z = 0.5, 1.7, 0.5
    return BoundingBox3DArray(header=Header(stamp=time_from(stamp_ns), frame_id=frame_id), boxes=[box] * count)
