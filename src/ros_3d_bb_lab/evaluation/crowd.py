"""Any number of people in one depth image: those of a measurement session, side by side."""
import itertools
from typing import NamedTuple, Tuple

import numpy as np

from ros_3d_bb.camera.camera_model import Camera
from ros_3d_bb.camera.depth_image import DepthImage
from ros_3d_bb.sessions.session_reader import read_depth

COVERED = 0.2  # of a box, by its neighbour
JITTER_PX = 2  # of the edges of a detector's box from image to image


class PersonCutout(NamedTuple):
    """Depth in the box of a person, (height, width), in the camera's units, and the row at which the box begins."""

    values: np.ndarray
    top: int


class Crowd(NamedTuple):
    """One wide depth image, the camera that would take it, and the boxes of the people in it."""

    depth: DepthImage
    camera: Camera
    rects_px: Tuple[Tuple[int, int, int, int], ...]

    def jittered(self, random):
        """The boxes as a detector would give them in another image of the same. List of (x1, y1, x2, y2)."""
        edges = np.array(self.rects_px) + random.randint(-JITTER_PX, JITTER_PX + 1, (len(self.rects_px), 4))
        size = self.camera.width, self.camera.height
        return [tuple(rect_px) for rect_px in np.clip(edges, 0, size + size).tolist()]


def people_of(session):
    """The people of a session, one of each frame that has a box, as the frame shows them. Raises SessionError."""
    people = []
    for frame in session.frames:
        if frame.boxes_px:
            x1, y1, x2, y2 = np.clip(frame.boxes_px[0], 0, (session.camera.width, session.camera.height) * 2)
            people.append(PersonCutout(read_depth(frame, session).values[y1:y2, x1:x2], int(y1)))
    return people


def crowd_of(people, count, session):
    """So many people, one after the other and from the first again; each covers a part of the one on the left.

    Parameters
    ----------
    people : sequence of PersonCutout
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
