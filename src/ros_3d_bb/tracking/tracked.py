"""What goes into a tracker and what comes out. Positions and sizes in the fixed frame (z up), metres."""
from typing import NamedTuple

import numpy as np

VISIBLE, OCCLUDED, OUT_OF_VIEW = 0, 1, 2


class Detection(NamedTuple):
    """One object in one image: centre (3,) and extent (3,), x = y = width, z = height."""

    position_m: np.ndarray
    size_m: np.ndarray


class TrackedObject(NamedTuple):
    """One object as the tracker knows it after one image.

    `velocity_mps` (3,) is filtered; `instant_velocity_mps` (3,) is that between the last two sightings, noisy.
    `prediction_m` (steps, 3) holds positions after 1, 2, 3, ... times `prediction_step_s`. Stamps in nanoseconds.
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
