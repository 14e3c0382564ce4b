"""2D boxes of simulated frames, as a very good detector returns them."""
import numpy as np

from ros_3d_bb.camera.camera_model import transform_points

LEAST_SHOWN = 0.3  # visible share of the body below which its position cannot be estimated
JITTER_PX = 1.0  # standard deviation of the edges


def jittered_boxes(frame, camera, seed):
    """True boxes (n, 4) of the people in a SimulatedFrame, with edges jittered by `JITTER_PX`.

    They are those of people with `is_in_image`, or with at least `LEAST_SHOWN` of the body visible.
    """
    random = np.random.RandomState([seed, frame.number])
    jitter_px = np.rint(random.normal(0, JITTER_PX, (len(frame.people), 4)))
    shown = [person.visible >= LEAST_SHOWN or is_in_image(person, frame.poses.map_from_camera, camera)
             for person in frame.people]
    boxes = [person.box_px + jitter for person, jitter, is_shown in zip(frame.people, jitter_px, shown) if is_shown]
    return np.clip(np.reshape(boxes, (-1, 4)), 0, [camera.width, camera.height] * 2)


def is_in_image(person, map_from_camera, camera):
    """Whether the body axis of a PersonTruth is between the left and right image borders, and not mostly occluded."""
    x_m, _y, z_m = transform_points(np.linalg.inv(map_from_camera), person.position_m)
    if person.box_px is None or person.hidden > 1 - LEAST_SHOWN or z_m <= 0:
        return False
    return bool(0 <= camera.fx * x_m / z_m + camera.cx < camera.width)
