"""From 3D boxes and transforms to tracks, without a master: what one wrong or untimely message does to the next."""
import numpy as np
import pytest
import tf2_ros
from sensor_msgs.msg import CameraInfo, Image
from std_msgs.msg import Header

from ros_3d_bb.camera.camera_model import OPTICAL_ROTATION, transform_from
from ros_3d_bb.conversions.perception_msgs import time_from
from ros_3d_bb.core.event_counter import EventCounter
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.msg import BoundingBox3D, BoundingBox3DArray
from ros_3d_bb.pipeline.tracking_stage import TRACKING_PARAMS, TrackerNodeParams, TrackingStage
from ros_3d_bb.tracking.types import VISIBLE

START_NS = 1000 * NS


class Transforms(object):
    """A camera that stands still, unknown at the stamps in `missing`."""

    def __init__(self):
        self.missing, self.jumps = set(), 0

    def lookup(self, _target, _source, stamp):
        if stamp.to_nsec() in self.missing:
            raise tf2_ros.LookupException('no such frame')
        return transform_from((0, 0, 1), OPTICAL_ROTATION)

    def go_back(self):
        self.jumps += 1


@pytest.fixture
def transforms():
    return Transforms()


@pytest.fixture
def events():
    return EventCounter()


@pytest.fixture
def follower(transforms, events):
    return TrackingStage(TrackerNodeParams(), [kind() for kind in TRACKING_PARAMS], events, transforms)


def boxes(stamp_ns, z=3.0, count=1):
    box = BoundingBox3D()
    box.center.position.z = z
    box.size.x, box.size.y, box.size.z = 0.5, 1.7, 0.5
    return BoundingBox3DArray(header=header(stamp_ns), boxes=[box] * count)


def header(stamp_ns):
    return Header(stamp=time_from(stamp_ns), frame_id='camera')


def stand(follower, seconds=1.0):
    """Somebody stands there; returns the stamp of the last image and what was followed."""
    for frame in range(int(30 * seconds)):
        stamp_ns = START_NS + frame * NS // 30
        followed = follower.add_boxes(boxes(stamp_ns), 0)
    return stamp_ns, followed


def test_tracks_have_the_stamp_of_an_image_that_was_taken(follower, transforms):
    """One image 0.9 s ahead has no transform, another one is nonsense: what follows is stamped as it is."""
    stamp_ns, _followed = stand(follower)
    ahead_ns = stamp_ns + 9 * NS // 10
    transforms.missing.add(ahead_ns)
    assert follower.add_boxes(boxes(ahead_ns), 0) is None
    with pytest.raises(ValueError, match='2000 3D boxes'):
        follower.add_boxes(boxes(ahead_ns + 1, count=2000), 0)
    followed = follower.add_boxes(boxes(stamp_ns + NS // 30), 0)
    assert followed.header.stamp == time_from(stamp_ns + NS // 30) and len(followed.tracks) == 1


def test_a_stamp_far_ahead_that_cannot_be_used_ends_nobody(follower, transforms):
    stamp_ns, before = stand(follower)
    transforms.missing.add(stamp_ns + 100 * NS)
    follower.add_boxes(boxes(stamp_ns + 100 * NS), 0)
    after = follower.add_boxes(boxes(stamp_ns + NS // 30), 0)
    assert [track.id for track in after.tracks] == [track.id for track in before.tracks] and not transforms.jumps


def test_time_that_goes_back_is_followed_once(follower, transforms, events):
    stamp_ns, before = stand(follower)
    transforms.missing.add(stamp_ns - 20 * NS)
    follower.add_boxes(boxes(stamp_ns - 20 * NS), 0)
    assert follower.add_boxes(boxes(stamp_ns - 19 * NS), 0).tracks == []
    assert transforms.jumps == 1 and events.counts['jumps back in time'] == 1
    assert follower.add_boxes(boxes(stamp_ns - 19 * NS + NS // 30), 0).header.stamp < before.header.stamp


def test_a_depth_image_that_cannot_be_used_does_not_keep_the_boxes_out(follower, events):
    follower.add_camera_info(CameraInfo(header=header(START_NS), width=4, height=3, K=[4, 0, 2, 0, 4, 1, 0, 0, 1]))
    depth = Image(header=header(START_NS), width=4, height=3, encoding='nonsense', step=8, data=b'0' * 24)
    follower.add_depth(depth, 0)
    assert follower.add_boxes(boxes(START_NS), 0) is not None
    assert events.counts['depth images rejected'] == 1


def test_more_boxes_than_people_can_be_are_refused(follower):
    with pytest.raises(ValueError, match='2000 3D boxes in one image; at most 1000'):
        follower.add_boxes(boxes(START_NS, count=2000), 0)
    assert np.isfinite(follower.add_boxes(boxes(START_NS), 0).header.stamp.to_sec())


def test_a_box_that_cannot_be_used_takes_no_other_with_it(follower, events):
    """A box as wide as a wall, and one without a place, come with each image of a person who stands there."""
    _stamp_ns, alone = stand(follower)
    for frame in range(30, 60):
        message = boxes(START_NS + frame * NS // 30)
        wall, nowhere = boxes(0).boxes + boxes(0, z=float('nan')).boxes
        wall.size.x, wall.size.y = 9.34, 10.93
        message.boxes = [wall, nowhere] + message.boxes
        track, = follower.add_boxes(message, 0).tracks
    assert track.id == alone.tracks[0].id and track.status == VISIBLE
    assert events.counts['3D boxes dropped'] == 60 and events.counts['images tracked'] == 60
    assert '3D boxes rejected' not in events.counts


def test_an_image_none_of_whose_boxes_can_be_used_does_not_age_tracks(follower, events):
    """It does not say that there are no people. The track is still published after a second of such images."""
    stamp_ns, before = stand(follower)
    for number in range(1, 31):
        with pytest.raises(ValueError, match='none'):
            follower.add_boxes(boxes(stamp_ns + number * NS // 30, z=float('nan')), 0)
    after = follower.add_boxes(boxes(stamp_ns + 31 * NS // 30), 0)
    assert [track.id for track in after.tracks] == [before.tracks[0].id]
    assert events.counts['3D boxes dropped'] == 30
