"""What goes into a tracker and what comes out. Positions and sizes in the fixed frame (z up), metres."""
from typing import NamedTuple, Optional, Tuple

import numpy as np

VISIBLE, OCCLUDED, OUT_OF_VIEW = 0, 1, 2


class Detection(NamedTuple):
    """One object in one image: centre (3,) and extent (3,), x = y = width, z = height.

    `covariance_m2` (3, 3) is that of the centre, None where it is not known. `truncated`: the image border cuts it.
    """

    position_m: np.ndarray
    size_m: np.ndarray
    covariance_m2: Optional[np.ndarray] = None
    truncated: bool = False


class View(NamedTuple):
    """Where the camera of an image was, (4, 4) from its optical frame, and how far to the left and right it sees.

    `edges` are x / z of what the left and the right image border show, None where they are not known. `camera` tells
    the images of one camera from those of another.
    """

    fixed_from_camera: np.ndarray
    edges: Optional[Tuple[float, float]] = None
    camera: str = ''


class TrackedObject(NamedTuple):
    """One object as the tracker knows it after one image.

    `velocity_mps` (3,) is filtered; `instant_velocity_mps` (3,) is that between the last two sightings, noisy.
    `prediction_m` (steps, 3) holds positions after 1, 2, 3, ... times `prediction_step_s`. Stamps in nanoseconds.
    `covariance` (6, 6) is over x, y, z and their velocities; `prediction_covariance_m2` (steps, 3, 3) over the
    predicted positions; both None for a tracker that does not know them.
    """

    id: int
    position_m: np.ndarray
    size_m: np.ndarray
    velocity_mps: np.ndarray
    instant_velocity_mps: np.ndarray
    status: int
    moving: bool
    first_seen_ns: int
    last_seen_ns: int
    prediction_m: np.ndarray
    prediction_step_s: float
    covariance: Optional[np.ndarray] = None
    prediction_covariance_m2: Optional[np.ndarray] = None
