"""Wrong input, for a few seconds; `./run fuzz` takes minutes. And what it found, each by itself."""
import genpy
import numpy as np
import pytest
from geometry_msgs.msg import TransformStamped
from sensor_msgs.msg import Image
from std_msgs.msg import Header
from tf2_msgs.msg import TFMessage

from fuzz.functions import FUNCTIONS, fuzz_functions
from fuzz.hostile import good_boxes, good_frame
from fuzz.nodes import TARGETS, fuzz_node
from ros_3d_bb.conversions.perception_msgs import stamp_of
from ros_3d_bb.msg import BoundingBox3DArray
from ros_3d_bb.nodes.bbox3d_node import Bbox3dNode
from ros_3d_bb.nodes.tracker_node import TrackerNode
from ros_3d_bb.planning.planner_view import usable_tracks
from ros_3d_bb.tracking.types import VISIBLE, TrackedObject
from ros_3d_bb.visualization import image_overlay
from support.masterless import masterless

TOPICS = ('camera/color/camera_info', 'camera/aligned_depth_to_color/image_raw', 'camera/color/image_raw',
          'yolo_bounding_box')


def test_functions_refuse_wrong_values_by_a_value_error():
    counts = fuzz_functions(7, 10000)
    assert sum(calls for calls, _refused in counts.values()) == 10000 and set(counts) == set(FUNCTIONS)
    refused = sum(refused for _calls, refused in counts.values())
    assert 2000 < refused < 9000  # wrong ones are there, and good ones


@pytest.mark.parametrize('name', sorted(TARGETS))
def test_nodes_live_through_wrong_messages_and_the_next_good_one_works(name):
    sent, _cpu_s = fuzz_node(name, 7, 1000)
    assert sent >= 1000


@pytest.mark.parametrize('secs', [2 ** 31, 2 ** 32 - 1])
def test_stamps_that_tf2_cannot_reckon_with_are_refused(secs):
    """Its C++ raises an exception that nobody catches, and the process ends."""
    with pytest.raises(ValueError, match='2038'):
        stamp_of(Image(header=Header(stamp=genpy.Time(secs))))
    assert stamp_of(Image(header=Header(stamp=genpy.Time(2 ** 31 - 1)))) > 0


@pytest.mark.parametrize('topic', ['/tf', '/tf_static'])
def test_transforms_with_such_stamps_are_refused_and_the_next_ones_serve(topic):
    with masterless({'tf_timeout': 0.0}) as connections:
        TrackerNode()
        for secs in (2 ** 32 - 1, 2 ** 31, 100):
            transform = TransformStamped(child_frame_id='camera')
            transform.header.frame_id, transform.header.stamp = 'map', genpy.Time(secs)
            transform.transform.rotation.w = 1.0
            connections.send(topic, TFMessage([transform]))
        connections.send('ros_3d_bb/bb_3d', BoundingBox3DArray(header=Header(stamp=genpy.Time(100), frame_id='camera')))
        assert connections.publishers['ros_3d_bb/tracks'].count == 1


def test_tracks_of_absurd_size_get_to_no_planner():
    """A costmap's points of a person of 1000 km would be petabytes."""
    track = TrackedObject(1, np.zeros(3), np.array([1e6, 1e6, 1.7]), np.zeros(3), np.zeros(3), VISIBLE, False, 0, 0,
                          np.zeros((0, 3)), 0.25)
    usable, faults = usable_tracks([track, track._replace(id=2, size_m=np.array([0.5, 0.5, 1.7]))])
    assert [kept.id for kept in usable] == [2] and len(faults) == 1


def test_edges_far_outside_the_image_are_not_walked_along(monkeypatch):
    """OpenCV takes a tenth of a second for one of 2^31 pixels."""
    corners = []
    monkeypatch.setattr(image_overlay.cv2, 'rectangle', lambda _image, *given: corners.extend(given[0] + given[1]))
    image_overlay.draw_boxes(np.zeros((48, 64, 3), np.uint8),
                             np.array([[-2 ** 31, 5, 2 ** 31 - 1, 20], [3, 4, 9, 1e300]]),
                             ['', ''])
    assert corners == [-4, 5, 68, 20, 3, 4, 9, 52]


def test_a_colour_image_that_cannot_be_shown_keeps_no_boxes_back():
    """Two arrays wait for one depth image, and the colour image is damaged: both are lifted all the same."""
    with masterless() as connections:
        Bbox3dNode()
        for stamp_ns, order in ((10 ** 12, (0, 1, 3)), (2 * 10 ** 12, (0, 2, 3, 3, 1))):
            frame = good_frame(stamp_ns)
            frame['yolo_bounding_box'] = good_boxes(stamp_ns)
            frame['camera/color/image_raw'].step = 1
            for number in order:
                connections.send(TOPICS[number], frame[TOPICS[number]])
        assert connections.publishers['ros_3d_bb/bb_3d'].count == 3


def test_a_colour_image_without_a_stamp_stops_no_picture():
    """It comes to a callback that is there only while somebody looks at the pictures."""
    with masterless() as connections:
        Bbox3dNode()
        for stamp_ns in (10 ** 12, 2 * 10 ** 12):
            frame = good_frame(stamp_ns)
            frame['yolo_bounding_box'] = good_boxes(stamp_ns)
            for topic in TOPICS:
                if topic in connections.subscribers:
                    connections.send(topic, frame[topic])
            connections.send('camera/color/image_raw', Image())
        assert connections.publishers['ros_3d_bb/color'].count == 1
