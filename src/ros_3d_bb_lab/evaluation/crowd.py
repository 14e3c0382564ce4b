"""Synthetic depth images with any number of people, composed of the people of a measurement session."""
import itertools
from typing import NamedTuple, Tuple

import numpy as np

from ros_3d_bb.camera.camera_model import Camera
from ros_3d_bb.camera.depth_image import DepthImage
from ros_3d_bb.sessions.session_reader import read_depth

COVERED = 0.2  # share of a box that its neighbour covers
JITTER_PX = 2  # maximum change of the edges of a box between images


class PersonCutout(NamedTuple):
    """Depth values in the box of a person, (height, width), in the camera's units, and the top row of the box."""

    values: np.ndarray
    top: int


class Crowd(NamedTuple):
    """Wide depth image, its camera, and the 2D boxes of the people in it."""

    depth: DepthImage
    camera: Camera
    rects_px: Tuple[Tuple[int, int, int, int], ...]

    def jittered(self, random):
        """Boxes with random jitter, as a detector returns them for another image of the same scene.

        Returns
        -------
        list of (x1, y1, x2, y2)
        """
        edges = np.array(self.rects_px) + random.randint(-JITTER_PX, JITTER_PX + 1, (len(self.rects_px), 4))
        size = self.camera.width, self.camera.height
        return [tuple(rect_px) for rect_px in np.clip(edges, 0, size + size).tolist()]


def people_of(session):
    """Cut out the annotated person of each frame that has a box. Raises SessionError."""
    people = []
    for frame in session.frames:
        if frame.boxes_px:
            x1, y1, x2, y2 = np.clip(frame.boxes_px[0], 0, (session.camera.width, session.camera.height) * 2)
            people.append(PersonCutout(read_depth(frame, session).values[y1:y2, x1:x2], int(y1)))
    return people


def crowd_of(people, count, session):
    """Place people side by side in one depth image. Each person covers a part of the person to the left.

    Parameters
    ----------
    people : sequence of PersonCutout
        Repeated cyclically if there are fewer than `count`.
    count : int
    session : session_reader.Session

    Returns
    -------
    Crowd
    """
    chosen = list(itertools.islice(itertools.cycle(people), count))
    steps = [int(person.values.shape[1] * (1 - COVERED)) for person in chosen]
    lefts = np.cumsum([0] + steps[:-1])
    rects_px = tuple((int(left), person.top, int(left) + person.values.shape[1], person.top + person.values.shape[0])
                     for left, person in zip(lefts, chosen))
    width = max(rect_px[2] for rect_px in rects_px)
    values = np.zeros((session.camera.height, width), chosen[0].values.dtype)
    for (x1, y1, x2, y2), person in zip(rects_px, chosen):
        values[y1:y2, x1:x2] = person.values
    camera = session.camera
    return Crowd(DepthImage(values, session.depth_scale_m),
                 Camera(width, camera.height, camera.fx, camera.fy, width / 2.0, camera.cy), rects_px)
