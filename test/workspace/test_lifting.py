"""From 2D boxes and depth to 3D boxes, without a master: what one wrong box does to the others of its image."""
import numpy as np
import pytest
from sensor_msgs.msg import CameraInfo, Image
from std_msgs.msg import Header

from ros_3d_bb.conversions.image_msgs import fill_image
from ros_3d_bb.conversions.perception_msgs import boxes2d_to_msg, boxes3d_to_msg, time_from, usable_boxes3d
from ros_3d_bb.core.event_counter import EventCounter
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.pipeline.estimation_stage import Bbox3dParams, EstimationStage

HEADER = Header(stamp=time_from(1000 * NS), frame_id='camera')
INTRINSICS = [614.7, 0, 319.2, 0, 614.8, 242.1, 0, 0, 1]
PERSON_PX, PERSON_M = (60, 150, 160, 460), 3.0
NEAR_PX = (230, 0, 640, 480)  # right before the camera, too near for depth: it shows the wall


@pytest.fixture
def events():
    return EventCounter()


def scene(wall_m, person_m=PERSON_M):
    """Depth (480, 640), metres: a person before a wall."""
    depth_m = np.full((480, 640), wall_m, np.float32)
    x1, y1, x2, y2 = PERSON_PX
    depth_m[y1:y2, x1:x2] = person_m
    return depth_m


def lift(depth_m, rects_px, events, estimator='foreground'):
    """The 3D boxes of an image, as a message and as they are."""
    results = []

    def on_frame(boxes2d, depth_msg, camera):
        header, _depth, boxes3d = lifter.estimate(boxes2d, depth_msg, camera)
        results.append(boxes3d_to_msg(boxes3d, header, camera))
        results.append(boxes3d)
    lifter = EstimationStage(Bbox3dParams(estimator=estimator), events, on_frame)
    lifter.add_camera_info(CameraInfo(header=HEADER, width=640, height=480, K=INTRINSICS), 0)
    lifter.add_depth(fill_image(Image(header=HEADER), depth_m, '32FC1'), 0)
    lifter.add_boxes(boxes2d_to_msg(np.array(rects_px), HEADER), 0)
    message, boxes3d = results
    return message, boxes3d


@pytest.mark.parametrize('estimator', ['foreground', 'median'])
def test_a_box_larger_than_anything_tracked_is_dropped_and_the_other_is_lifted(estimator, events):
    depth_m = scene(wall_m=14.0)
    depth_m[:, 230:][np.random.RandomState(0).rand(480, 410) > 0.2] = 0  # too near to be measured
    message, (box,) = lift(depth_m, [PERSON_PX, NEAR_PX], events, estimator)
    assert box.rect_px == PERSON_PX and box.center_m[2] == pytest.approx(PERSON_M, abs=0.1)
    assert events.counts['boxes of impossible size'] == 1
    assert events.counts['boxes lifted'] == 1 and events.counts['boxes without depth'] == 0
    _usable, faults = usable_boxes3d(message)
    assert not faults


def test_a_box_that_is_dropped_takes_no_depth_from_the_others(events):
    """The person stands 0.2 m before the wall that fills the large box: in its layer of depth."""
    _message, (box,) = lift(scene(wall_m=14.0, person_m=13.8), [(0, 0, 640, 480), PERSON_PX], events)
    assert box.rect_px == PERSON_PX and events.counts['boxes of impossible size'] == 1


def test_the_size_of_boxes_of_any_pixels_is_checked(events):
    rects_px = [(-2 ** 31, -2 ** 31, 2 ** 31 - 1, 2 ** 31 - 1), (5, 5, 5, 9), PERSON_PX]
    _message, (box,) = lift(scene(wall_m=5.0), rects_px, events, 'median')
    assert box.rect_px == PERSON_PX
    assert events.counts['boxes of impossible size'] == 1 and events.counts['boxes rejected'] == 1
