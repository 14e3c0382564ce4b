"""Differential drive: velocities within limits, and the poses to which they lead.

Convention: poses are (x, y, heading), velocities (linear, angular); metres, radians, seconds. `scenario.Drive` contains
the limits.
"""
import numpy as np


def limited_velocity(velocity, wanted, drive, step_s):
    """Velocity (2,) after a time step towards the wanted one, within the limits of speed and acceleration."""
    fastest = np.array([drive.speed, drive.rate])
    change = np.array([drive.acceleration, drive.angular_acceleration]) * step_s
    return velocity + np.clip(np.clip(wanted, -fastest, fastest) - velocity, -change, change)


def moved(pose, velocity, step_s):
    """Pose (3,) after a time step at constant velocity, which is an arc of a circle."""
    turn = velocity[1] * step_s
    chord_m = velocity[0] * step_s * np.sinc(turn / 2 / np.pi)
    heading = pose[2] + turn / 2
    return pose + np.array([chord_m * np.cos(heading), chord_m * np.sin(heading), turn])


def measured_velocity(velocity, error):
    """Velocity (2,) according to odometry, whose relative errors of linear and angular velocity are `error`."""
    return velocity * (1 + np.asarray(error))
