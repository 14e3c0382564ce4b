"""Boxes and visibility for cameras of any mount, against ray casting of upright cylinders."""
import functools

import numpy as np
from hypothesis import assume, example, given, settings, strategies as st

from ros_3d_bb.camera.camera_model import Camera
from ros_3d_bb.estimation.box3d_estimator import estimate_boxes, estimator_named
from ros_3d_bb.tracking.occlusion import classify_visibility, depths_towards
from ros_3d_bb.tracking.types import OCCLUDED, VISIBLE, CameraView, detections_from_boxes
from support.cylinders import Cylinder, mounted, rect_of, render

LANDSCAPE, PORTRAIT = Camera(160, 120, 110, 110, 79.5, 59.5), Camera(120, 160, 110, 110, 59.5, 79.5)
FOREGROUND = estimator_named('foreground')
ROLLS = st.sampled_from([0, 90, 180, 270])
SIZE_M = np.array([[0.5, 0.5, 1.7]])


def camera_for(roll_deg):
    """A camera whose image is wider than high once it is upright."""
    return PORTRAIT if roll_deg % 180 else LANDSCAPE


def pillar_before(person, share, beside_m):
    """A pillar on the way to a person, at a share of it, and beside the line of sight by so much."""
    distance_m = np.hypot(person.x_m, person.y_m)
    return Cylinder(share * person.x_m - beside_m * person.y_m / distance_m,
                    share * person.y_m + beside_m * person.x_m / distance_m, 0.25, 2.6)


@example(height_m=0.3, pitch_deg=17.0, roll_deg=90, x_m=2.0, bearing=0.0, share=0.5, beside_m=0)
@settings(max_examples=25, deadline=None)
@given(height_m=st.floats(0.3, 2.5), pitch_deg=st.floats(-10, 45), roll_deg=ROLLS, x_m=st.floats(2, 6),
       bearing=st.floats(-0.3, 0.3), share=st.floats(0.3, 0.6), beside_m=st.sampled_from([0, 0, 0.65, -0.65]))
def test_a_pillar_hides_a_person_where_no_ray_reaches_the_body(height_m, pitch_deg, roll_deg, x_m, bearing, share,
                                                               beside_m):
    camera, view_from = camera_for(roll_deg), mounted(height_m, pitch_deg, roll_deg)
    person = Cylinder(x_m, bearing * x_m)
    pillar = pillar_before(person, share, beside_m)
    alone, shown = (render(camera, view_from, things)[1] == 0 for things in ([person], [person, pillar]))
    assume(alone.sum() > 60)
    seen_share = shown.sum() / alone.sum()
    assume(not 0.1 < seen_share < 0.9)
    depth = render(camera, view_from, [pillar])[0]  # the person has gone
    view = CameraView(view_from, camera, depth_at=functools.partial(depths_towards, camera, depth))
    place_m = np.array([[person.x_m, person.y_m, 0.85]])
    place, = classify_visibility(view, place_m, SIZE_M, place_m, 20.0)
    assert place != (VISIBLE if seen_share <= 0.1 else OCCLUDED)


@settings(max_examples=50, deadline=None)
@example(height_m=1.0, pitch_deg=0.0, roll_deg=90, x_m=0.6, bearing=0.4)
@example(height_m=0.3, pitch_deg=0.0, roll_deg=270, x_m=1.5, bearing=0.0)
@given(height_m=st.floats(0.3, 1.5), pitch_deg=st.floats(-10, 10), roll_deg=ROLLS, x_m=st.floats(0.6, 5.0),
       bearing=st.floats(-0.6, 0.6))
def test_a_cut_body_is_completed_the_way_it_stands(height_m, pitch_deg, roll_deg, x_m, bearing):
    camera, map_from_camera = camera_for(roll_deg), mounted(height_m, pitch_deg, roll_deg)
    person = Cylinder(x_m, bearing * x_m)
    depth, shown = render(camera, map_from_camera, [person])
    assume((shown == 0).sum() > 60)
    box, = estimate_boxes(depth, [rect_of(shown, 0)], camera, FOREGROUND)
    assume(box is not None)
    detection, = detections_from_boxes({0: box}, map_from_camera)
    _left, top, _right, bottom = detection.truncated_edges
    assert detection.size_m[0] < 0.65
    assert np.hypot(detection.position_m[0] - person.x_m, detection.position_m[1] - person.y_m) < 0.3
    if not (top and bottom) and x_m > 1:
        assert abs(detection.size_m[2] - person.height_m) < 0.25
        assert abs(detection.position_m[2] - person.height_m / 2) < 0.2
