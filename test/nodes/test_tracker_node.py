"""tracker_node with generated 3D boxes. Needs a master because of tf2."""
import itertools
import time

import pytest
from dynamic_reconfigure.client import Client
from nav_msgs.msg import OccupancyGrid
from tf2_msgs.msg import TFMessage
from visualization_msgs.msg import MarkerArray

from ros_3d_bb.conversions.camera_msgs import transform_messages
from ros_3d_bb.conversions.perception_msgs import time_from
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.msg import BoundingBox3DArray, TrackedObject, TrackedObjectArray
from support.people import mounted
from support.ros import TIMEOUT_S, Recorder, diagnostics_of, header_at, publisher, wait_until
from support.two_cameras import boxes

PERIOD, CAMERA = NS // 10, 'camera_color_optical_frame'
_stamps = itertools.count(1000 * NS, 100 * NS)


class Rig(object):
    """A camera that points along x of the map, on a robot, and the output of the node."""

    def __init__(self):
        self.boxes = publisher('ros_3d_bb/bb_3d', BoundingBox3DArray)
        self.tf = publisher('/tf', TFMessage)
        self.tracks = Recorder('ros_3d_bb/tracks', TrackedObjectArray)

    def send_tf(self, stamp_ns):
        self.tf.publish(TFMessage(transform_messages(time_from(stamp_ns), [('map', CAMERA, mounted(1.0))])))

    def send(self, stamp_ns, *centers):
        """Boxes at camera coordinates (right, down, forward), and the transform at their stamp."""
        self.send_tf(stamp_ns)
        self.send_boxes(stamp_ns, *centers)

    def send_boxes(self, stamp_ns, *centers):
        self.boxes.publish(boxes(stamp_ns, CAMERA, centers))


@pytest.fixture(scope='module')
def rig():
    return Rig()


@pytest.fixture
def tracks(rig):
    return rig.tracks.emptied()


@pytest.fixture
def now():
    """A stamp for this test; the tracks of the test before are over by then."""
    return next(_stamps)


def test_tracks_are_in_the_map_at_the_stamp_of_the_image(rig, tracks, now):
    """1 m right, 0.2 m down and 3 m in front of a camera 1 m above the map: x 3, y -1, z 0.8."""
    for frame in range(5):
        rig.send(now + frame * PERIOD, (1.0, 0.2, 3.0))
    message = tracks.wait_for(5)[-1]
    assert message.header.frame_id == 'map' and message.header.stamp == time_from(now + 4 * PERIOD)
    track, = message.objects
    place = track.pose.pose.position
    assert (place.x, place.y, place.z) == pytest.approx((3, -1, 0.8), abs=0.01)
    assert (track.size.x, track.size.y, track.size.z) == pytest.approx((0.5, 0.5, 1.7))
    assert track.id >= 1 and track.status == TrackedObject.VISIBLE and not track.moving
    assert track.first_seen == time_from(now) and track.last_seen == time_from(now + 4 * PERIOD)
    assert len(track.prediction) == 8 and track.prediction_step.to_sec() == pytest.approx(0.25)
    assert track.pose.pose.orientation.w == 1.0
    assert 0 < track.pose.covariance[0] < 0.1 and 0 < track.twist.covariance[0]
    assert track.pose.covariance[0] < track.prediction[0].covariance[0] < track.prediction[-1].covariance[0]


def test_a_late_transform_is_awaited(rig, tracks, now):
    rig.send_boxes(now, (0.0, 0.0, 3.0))
    time.sleep(0.02)
    rig.send_tf(now)
    assert tracks.wait_for(1)[0].header.stamp == time_from(now)


def test_no_track_starts_in_ignored_areas_nor_behind_cells_of_the_map(rig, tracks, now):
    """A person 3 m ahead, one in an area at 5 m, and a poster on a wall at 7 m; the wall ends before y = 2."""
    grid = OccupancyGrid(header=header_at(0, 'map'), data=[100] * 20)
    grid.info.width, grid.info.height, grid.info.resolution = 1, 20, 0.1
    grid.info.origin.position.x, grid.info.origin.position.y, grid.info.origin.orientation.w = 7.0, -1.0, 1.0
    publisher('static_map', OccupancyGrid).publish(grid)
    wait_until(lambda: diagnostics_of('tracker_node')[2].get('maps used'), 'the map')
    client = Client('tracker_node', timeout=TIMEOUT_S)
    client.update_configuration({'ignored_areas': '[[[4.5, -0.5], [5.5, -0.5], [5.5, 0.5], [4.5, 0.5]]]'})
    client.close()
    with Recorder('visualization_marker_array', MarkerArray) as markers:
        for frame in range(10):
            rig.send(now + frame * PERIOD, (1.0, 0.2, 3.0), (0.0, 0.2, 5.0), (0.0, 0.2, 7.2), (-2.0, 0.2, 7.2))
            message = tracks.wait_for(frame + 1)[-1]
        assert 'ignored_area' in [marker.ns for marker in markers.wait_for(1)[0].markers]
    assert sorted(round(track.pose.pose.position.y) for track in message.objects) == [-1, 2]
    assert diagnostics_of('tracker_node')[2]['boxes in ignored areas'] >= 20
