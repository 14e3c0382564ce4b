"""Social force model of pedestrians: D. Helbing, P. Molnar, Phys. Rev. E 51, 4282 (1995).

The constants are those of the paper. Convention: map frame, metres, seconds.
"""
import numpy as np

RELAXATION_S = 0.5
MAX_SPEED_MPS = 1.3 * 1.34
PEDESTRIAN_POTENTIAL, PEDESTRIAN_RANGE_M = 2.1, 0.3  # m^2/s^2
BORDER_POTENTIAL, BORDER_RANGE_M = 10.0, 0.2  # m^2/s^2
STEP_S = 2.0  # pedestrians anticipate the next step of the others
SIGHT_RAD, UNSEEN_WEIGHT = np.radians(100), 0.5  # half the angle of sight, and the weight of forces from behind
NEAREST_M = 1e-3


def next_velocity(velocity, acceleration, step_s):
    """Velocity (2,) after a time step, at most `MAX_SPEED_MPS`."""
    velocity = velocity + acceleration * step_s
    return velocity * min(1.0, MAX_SPEED_MPS / max(np.linalg.norm(velocity), NEAREST_M))


def driving_force(velocity, desired_velocity):
    """Acceleration (2,) towards the desired velocity."""
    return (desired_velocity - velocity) / RELAXATION_S


def pedestrian_forces(offsets, velocities):
    """Accelerations (n, 2) away from other pedestrians.

    `offsets` (n, 2) point from the others, whose velocities are (n, 2), to this one. The potential is constant on
    ellipses whose foci are the other pedestrian and the end of their next step.
    """
    steps = velocities * STEP_S
    start_m, end_m = _lengths(offsets), _lengths(offsets - steps)
    sum_m = start_m + end_m
    semi_minor_m = np.maximum(np.sqrt(np.maximum(sum_m ** 2 - (steps ** 2).sum(axis=1, keepdims=True), 0)) / 2,
                              NEAREST_M)
    gradients = sum_m / (4 * semi_minor_m) * (offsets / start_m + (offsets - steps) / end_m)
    return PEDESTRIAN_POTENTIAL / PEDESTRIAN_RANGE_M * np.exp(-semi_minor_m / PEDESTRIAN_RANGE_M) * gradients


def border_forces(offsets):
    """Accelerations (n, 2) away from borders. `offsets` (n, 2) point from their nearest points to the pedestrian."""
    distances_m = _lengths(offsets)
    return BORDER_POTENTIAL / BORDER_RANGE_M * np.exp(-distances_m / BORDER_RANGE_M) * offsets / distances_m


def sight_weights(direction, forces):
    """Weights (n, 1) of forces on a pedestrian who desires to walk in a direction: less if their cause is unseen."""
    limits = np.linalg.norm(direction) * np.linalg.norm(forces, axis=1) * np.cos(SIGHT_RAD)
    return np.where(-forces.dot(direction) >= limits, 1.0, UNSEEN_WEIGHT)[:, None]


def social_force(velocity, desired_velocity, offsets, velocities, border_offsets):
    """Total acceleration (2,) of a pedestrian; see `pedestrian_forces` and `border_forces` for the arguments."""
    forces = pedestrian_forces(offsets, velocities)
    repulsion = (sight_weights(desired_velocity, forces) * forces).sum(axis=0)
    return driving_force(velocity, desired_velocity) + repulsion + border_forces(border_offsets).sum(axis=0)


def _lengths(vectors):
    return np.maximum(np.linalg.norm(vectors, axis=1), NEAREST_M)[:, None]
