import contextlib
import os

import numpy as np
import pytest
from sensor_msgs.msg import CameraInfo, Image
from std_msgs.msg import Header

from ros_3d_bb.camera.images import mounted_camera
from ros_3d_bb.conversions.camera_msgs import transform_messages
from ros_3d_bb.conversions.image_msgs import fill_image
from ros_3d_bb.conversions.perception_msgs import (boxes2d_to_msg, boxes3d_to_msg, camera_from_msg, header_of,
                                                   time_from, usable_boxes3d)
from ros_3d_bb.core.event_counter import EventCounter
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.estimation.box3d import NO_DEPTH
from ros_3d_bb.pipeline.estimation_stage import Bbox3dParams, EstimationStage
from ros_3d_bb.pipeline.rgbd_source import TILT_FROM_ROOT, TILT_UNKNOWN, RgbdSource
from ros_3d_bb.pipeline.transform_buffer import TransformBuffer

HEADER = Header(stamp=time_from(1000 * NS), frame_id='camera')
CAMERA_INFO = CameraInfo(header=HEADER, width=640, height=480, K=[614.7, 0, 319.2, 0, 614.8, 242.1, 0, 0, 1])
PERSON_PX, PERSON_M = (60, 150, 160, 460), 3.0
TALL_AT_M = 3.4  # distance at which the person is 1.71 m tall
NEAR_PX = (230, 0, 640, 480)  # directly in front of the camera, too near for depth: the wall behind is measured
MODELS = os.path.join(os.path.dirname(os.path.abspath(__file__)), os.pardir, os.pardir, 'config', 'error_models')


@pytest.fixture
def events():
    return EventCounter()


def scene(wall_m, person_m=PERSON_M):
    """Depth (480, 640), metres: a person in front of a wall."""
    depth_m = np.full((480, 640), wall_m, np.float32)
    x1, y1, x2, y2 = PERSON_PX
    depth_m[y1:y2, x1:x2] = person_m
    return depth_m


class Estimation(object):
    """A source with one camera_info, and the estimation stage; `boxes3d` has the results of all frames."""

    def __init__(self, params, events, transforms=None):
        self.stage, self.boxes3d = EstimationStage(params, events), []
        self._source = RgbdSource(params, events, self._on_match, transforms)
        self._source.add_camera_info(CAMERA_INFO, 0)

    def _on_match(self, boxes2d, *messages):
        self.boxes3d += self.stage.estimate(self._source.frame(boxes2d, *messages), boxes2d)

    def add_depth(self, depth, header=HEADER, encoding='32FC1'):
        self._source.add_depth(fill_image(Image(header=header), depth, encoding), 0)

    def add_boxes(self, rects_px, labels=None, scores=None, header=HEADER, image_size=None):
        self._source.add_boxes(boxes2d_to_msg(np.array(rects_px), header, labels, scores, image_size), 0)


def test_without_floor_frame_the_tilt_is_that_in_the_root_of_tf(events):
    """Of a robot without base_link: the same positions as with the root as ~floor_frame. A level camera differs."""
    link, = transform_messages(time_from(NS), [('odom', 'camera', mounted_camera(1.0, 0.4, 0))])
    transforms, lengths_m = TransformBuffer(), []
    transforms.set_transform_static(link, '')
    for params, known in ((Bbox3dParams(), transforms), (Bbox3dParams(floor_frame='odom'), transforms),
                          (Bbox3dParams(floor_frame=''), None)):
        run = Estimation(params, events, known)
        run.add_depth(scene(6.0))
        run.add_boxes([PERSON_PX])
        lengths_m.append(run.boxes3d[0].center_m[2])
    assert lengths_m[0] == lengths_m[1] != lengths_m[2]
    assert events.counts[TILT_FROM_ROOT] == 1 and TILT_UNKNOWN not in events.counts


@pytest.mark.parametrize('image_size, found', [(None, 1), ((640, 480), 1), ((320, 240), 0)])
def test_boxes_in_a_resized_image_are_rejected(image_size, found):
    """Their pixels are not those of the camera_info."""
    run = Estimation(Bbox3dParams(), EventCounter())
    run.add_depth(scene(6.0))
    with contextlib.ExitStack() as stack:
        if not found:
            stack.enter_context(pytest.raises(ValueError, match='320 x 240 pixels, its camera_info on .* 640 x 480'))
        run.add_boxes([PERSON_PX], image_size=image_size)
    assert len(run.boxes3d) == found


def test_boxes_have_the_stamp_of_their_depth_image_which_is_used_once():
    """Colour images have twice the rate of depth images, and other stamps."""
    events, headers = EventCounter(), []
    source = RgbdSource(Bbox3dParams(), events, lambda *messages: headers.append(header_of(source.frame(*messages))))
    source.add_camera_info(CAMERA_INFO, 0)
    depth_stamps_ns = [1000 * NS + number * NS // 15 for number in range(5)]
    for stamp_ns in depth_stamps_ns:
        header = Header(stamp=time_from(stamp_ns), frame_id='camera')
        source.add_depth(fill_image(Image(header=header), scene(6.0), '32FC1'), 0)
    for number in range(8):
        header = Header(stamp=time_from(1000 * NS + NS // 100 + number * NS // 30), frame_id='camera')
        source.add_boxes(boxes2d_to_msg(np.array([PERSON_PX]), header), 0)
    source.end()
    assert [header.stamp.to_nsec() for header in headers] == depth_stamps_ns
    assert events.counts['images with a used depth image'] == 3


def estimate(depth_m, rects_px, events, estimator='foreground', labels=None, scores=None, **params):
    """The 3D boxes of an image. All of them can be tracked, and their regions are inside the image."""
    run = Estimation(Bbox3dParams(estimator=estimator, **params), events)
    run.add_depth(depth_m)
    run.add_boxes(rects_px, labels, scores)
    message = boxes3d_to_msg(run.boxes3d, HEADER, camera_from_msg(CAMERA_INFO))
    assert not usable_boxes3d(message)[1]
    assert all(box.roi.x_offset + box.roi.width <= 640 for box in message.boxes)
    return run.boxes3d


@pytest.mark.parametrize('estimator', ['foreground', 'median'])
def test_an_implausibly_large_box_is_dropped_and_the_other_is_kept(estimator, events):
    depth_m = scene(wall_m=14.0)
    depth_m[:, 230:][np.random.RandomState(0).rand(480, 410) > 0.2] = 0  # too near to be measured
    box, = estimate(depth_m, [PERSON_PX, NEAR_PX], events, estimator)
    assert box.rect_px == PERSON_PX and box.center_m[2] == pytest.approx(PERSON_M, abs=0.1)
    assert events.counts['boxes of impossible size'] == 1
    assert events.counts['boxes estimated'] == 1 and NO_DEPTH not in events.counts


@pytest.mark.parametrize('units_per_m,depth_scale,reported', [
    (5000, 0.0, '0.0002'), (4000, 0.0, '0.00025'), (1000, 0.0, None), (5000, 0.0002, None)])
def test_depth_of_a_wrong_scale_is_reported_with_the_correct_one(units_per_m, depth_scale, reported, events):
    run = Estimation(Bbox3dParams(depth_scale=depth_scale), events)
    for number in range(30):
        header = Header(stamp=time_from((1000 + number) * NS), frame_id='camera')
        values = (scene(wall_m=5.0, person_m=TALL_AT_M) * units_per_m).astype(np.uint16)
        run.add_depth(values, header, '16UC1')
        run.add_boxes([PERSON_PX], header=header)
    assert events.counts.get('depth of a wrong scale', 0) == (reported is not None)
    if reported:
        assert not run.boxes3d and events.counts['boxes of impossible size'] > 25
        assert 'depth_scale: %s ' % reported in events.sentences['depth of a wrong scale']
    else:
        assert len(run.boxes3d) > 25 and run.boxes3d[0].center_m[2] == pytest.approx(TALL_AT_M, abs=0.1)


def params(model, estimator):
    return Bbox3dParams(estimator=estimator, error_model=os.path.join(MODELS, model + '.yaml'))


def test_an_error_model_is_rejected_for_another_estimator():
    stage = EstimationStage(params('d435i_thesis', 'foreground'), EventCounter())
    estimator = stage.estimator
    with pytest.raises(ValueError, match='is for the estimator foreground, not median'):
        stage.reconfigure(params('d435i_thesis', 'median'))
    assert stage.estimator is estimator
    with pytest.raises(ValueError, match='is for the estimator median, not foreground'):
        EstimationStage(params('thesis', 'foreground'), EventCounter())


def test_a_missing_error_model_is_named():
    with pytest.raises(ValueError, match='nowhere.yaml.*absolute path expected'):
        EstimationStage(params('nowhere', 'median'), EventCounter())


def test_classes_and_scores_stay_with_their_boxes(events):
    """Of four boxes, the second one is reversed and the third one has no depth."""
    depth_m = scene(wall_m=5.0)
    depth_m[200:300, 400:500] = 0
    rects_px = [PERSON_PX, (9, 5, 5, 9), (410, 210, 490, 290), (250, 150, 350, 460)]
    depth_m[150:460, 250:350] = 4.0
    boxes = estimate(depth_m, rects_px, events, labels=['dog', 'cat', 'chair', 'drone'], scores=[0.5, 0.6, 0.7, 0.8])
    assert [(box.label, box.score, box.rect_px) for box in boxes] == [('dog', 0.5, rects_px[0]),
                                                                      ('drone', 0.8, rects_px[3])]


def test_another_table_of_classes_is_used(tmp_path, events):
    path = tmp_path / 'classes.yaml'
    path.write_text('classes: {person: {axis: 0.2}}\ndefault: {axis: 0.4}')
    for label, behind_m in (('person', 0.2), ('drone', 0.4)):
        box, = estimate(scene(wall_m=5.0), [PERSON_PX], events, labels=[label], classes_file=str(path))
        assert box.center_m[2] == pytest.approx(PERSON_M + behind_m, abs=1e-3)
    with pytest.raises(ValueError, match='nowhere.yaml'):
        EstimationStage(Bbox3dParams(classes_file='/nowhere.yaml'), events)
