"""Estimation stage: effect of one invalid 2D box on the others of its image, and the parameter ~error_model."""
import os

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


class Tilting(object):
    """Transforms of a camera with the given vectors that point up, one for each image."""

    def __init__(self, ups):
        self._ups = iter(ups)

    def lookup(self, _target_frame, _source_frame, _stamp):
        camera_from_floor = np.eye(4)
        camera_from_floor[:3, 2] = next(self._ups)
        return camera_from_floor


def test_each_image_has_the_tilt_of_the_camera_at_its_time():
    ups = (0, -1, 0), (0, -1, 0), (0, -np.cos(0.4), np.sin(0.4)), (0, -1, 0)
    lengths_m = []

    def on_frame(*frame):
        _header, _depth, (box,) = stage.estimate(*frame)
        lengths_m.append(box.center_m[2])
    stage = EstimationStage(Bbox3dParams(), EventCounter(), on_frame, Tilting(ups))
    stage.add_camera_info(CameraInfo(header=HEADER, width=640, height=480, K=INTRINSICS), 0)
    stage.add_depth(fill_image(Image(header=HEADER), scene(6.0), '32FC1'), 0)
    for _image in ups:
        stage.add_boxes(boxes2d_to_msg(np.array([PERSON_PX]), HEADER), 0)
    assert lengths_m[0] == lengths_m[1] == lengths_m[3] != lengths_m[2]


def estimate(depth_m, rects_px, events, estimator='foreground', labels=None, scores=None, **params):
    """The 3D boxes of an image. All of them can be tracked, and their regions are inside the image."""
    results = []

    def on_frame(boxes2d, depth_msg, camera):
        header, _depth, boxes3d = stage.estimate(boxes2d, depth_msg, camera)
        message = boxes3d_to_msg(boxes3d, header, camera)
        assert not usable_boxes3d(message)[1]
        assert all(box.roi.x_offset + box.roi.width <= 640 for box in message.boxes)
        results.extend(boxes3d)
    stage = EstimationStage(Bbox3dParams(estimator=estimator, **params), events, on_frame)
    stage.add_camera_info(CameraInfo(header=HEADER, width=640, height=480, K=INTRINSICS), 0)
    stage.add_depth(fill_image(Image(header=HEADER), depth_m, '32FC1'), 0)
    stage.add_boxes(boxes2d_to_msg(np.array(rects_px), HEADER, labels, scores), 0)
    return results


@pytest.mark.parametrize('estimator', ['foreground', 'median'])
def test_an_implausibly_large_box_is_dropped_and_the_other_is_kept(estimator, events):
    depth_m = scene(wall_m=14.0)
    depth_m[:, 230:][np.random.RandomState(0).rand(480, 410) > 0.2] = 0  # too near to be measured
    box, = estimate(depth_m, [PERSON_PX, NEAR_PX], events, estimator)
    assert box.rect_px == PERSON_PX and box.center_m[2] == pytest.approx(PERSON_M, abs=0.1)
    assert events.counts['boxes of impossible size'] == 1
    assert events.counts['boxes estimated'] == 1 and events.counts['boxes without depth'] == 0


def test_an_implausible_box_does_not_mask_the_pixels_of_others(events):
    """The person stands 0.2 m in front of the wall that fills the large box: in its layer of depth."""
    box, = estimate(scene(wall_m=14.0, person_m=13.8), [(0, 0, 640, 480), PERSON_PX], events)
    assert box.rect_px == PERSON_PX and events.counts['boxes of impossible size'] == 1


def test_rectangles_with_extreme_or_reversed_edges(events):
    rects_px = [(-2 ** 31, -2 ** 31, 2 ** 31 - 1, 2 ** 31 - 1), (5, 5, 5, 9), (9, 5, 5, 9), (1000, 900, 1100, 990),
                (-9, 100, 650, 480), PERSON_PX]
    wide, person = estimate(scene(wall_m=5.0), rects_px, events, 'median')
    assert person.rect_px == PERSON_PX and wide.truncated_edges == (True, False, True, True)
    assert events.counts['boxes of impossible size'] == 1 and events.counts['boxes rejected'] == 2
    assert events.counts['boxes without depth'] == 1


@pytest.mark.parametrize('units_per_m,depth_scale,reported', [(5000, 0.0, '0.0002'), (1000, 0.0, None),
                                                              (5000, 0.0002, None)])
def test_depth_of_a_wrong_scale_is_reported_with_the_correct_one(units_per_m, depth_scale, reported, events):
    results = []

    def on_frame(boxes2d, depth_msg, camera):
        results.extend(stage.estimate(boxes2d, depth_msg, camera)[2])
    stage = EstimationStage(Bbox3dParams(depth_scale=depth_scale), events, on_frame)
    stage.add_camera_info(CameraInfo(header=HEADER, width=640, height=480, K=INTRINSICS), 0)
    for number in range(30):
        header = Header(stamp=time_from((1000 + number) * NS), frame_id='camera')
        values = (scene(wall_m=5.0) * units_per_m).astype(np.uint16)
        stage.add_depth(fill_image(Image(header=header), values, '16UC1'), 0)
        stage.add_boxes(boxes2d_to_msg(np.array([PERSON_PX]), header), 0)
    assert len(results) > 25 and events.counts.get('depth of a wrong scale', 0) == (reported is not None)
    if reported:
        assert 'depth_scale: %s ' % reported in events.sentences['depth of a wrong scale']
    else:
        assert results[0].center_m[2] == pytest.approx(PERSON_M, abs=0.1)


def params(model, estimator):
    return Bbox3dParams(estimator=estimator, error_model=os.path.join(MODELS, model + '.yaml'))


@pytest.mark.parametrize('model,estimator,other', [('d435i_thesis', 'foreground', 'median'),
                                                   ('simulated_d435i', 'foreground', 'median'),
                                                   ('thesis', 'median', 'foreground')])
def test_an_error_model_is_rejected_for_another_estimator(model, estimator, other):
    stage = EstimationStage(params(model, estimator), EventCounter(), None)
    sample = stage.sample
    with pytest.raises(ValueError, match='is for the estimator %s, not %s' % (estimator, other)):
        stage.reconfigure(params(model, other))
    assert stage.sample is sample
    with pytest.raises(ValueError, match='is for the estimator %s, not %s' % (estimator, other)):
        EstimationStage(params(model, other), EventCounter(), None)


def test_a_missing_error_model_is_named():
    with pytest.raises(ValueError, match='nowhere.yaml.*absolute path expected'):
        EstimationStage(params('nowhere', 'median'), EventCounter(), None)


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
        EstimationStage(Bbox3dParams(classes_file='/nowhere.yaml'), events, None)


def test_only_heights_of_people_tell_the_scale_of_depth(events):
    """Toys of 0.3 m are possible, people of 0.3 m are not."""
    results = []

    def on_frame(boxes2d, depth_msg, camera):
        results.extend(stage.estimate(boxes2d, depth_msg, camera)[2])
    stage = EstimationStage(Bbox3dParams(), events, on_frame)
    stage.add_camera_info(CameraInfo(header=HEADER, width=640, height=480, K=INTRINSICS), 0)
    for number in range(60):
        header = Header(stamp=time_from((1000 + number) * NS), frame_id='camera')
        stage.add_depth(fill_image(Image(header=header), scene(wall_m=5.0, person_m=0.6), '32FC1'), 0)
        label = 'toy' if number < 30 else 'person'
        stage.add_boxes(boxes2d_to_msg(np.array([PERSON_PX]), header, [label]), 0)
        assert ('depth of a wrong scale' in events.counts) <= (number >= 30)
    assert len(results) >= 59 and events.counts['depth of a wrong scale'] == 1
