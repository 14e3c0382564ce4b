"""Theoretical depth error of stereo cameras (thesis 5.2)."""
import numpy as np

SUBPIXEL_PX = 0.08  # subpixel matching error of the D435 according to Intel (thesis 5.2)
THESIS_FOV_DEG, THESIS_WIDTH_PX, THESIS_BASELINE_M = 69.0, 640, 0.05
# Determined from the depth images of the thesis' D435i: all depths are 610.14 m / n with integer n, in units of 1/32
# pixel of disparity.
STEREO_PX_M = 19.067
THESIS_TABLES = 'measurements_combined.csv', 'new_measurements.csv', 'measurements_without_edges.csv'
# mean error and largest variance of each axis in the thesis
THESIS_RESULTS = {'Z': ((-0.04, 0.06, 0.008), 0.00225), 'X': ((-0.106, -0.006), 0.00032)}
COLOR_FOCAL_PX = 614.686  # of the thesis' colour camera at 640x480; its depth is aligned to colour


def focal_px(fov_deg, width_px):
    """Convert a horizontal field of view to the focal length in pixels. Inverse of `fov_deg`."""
    return width_px / (2 * np.tan(np.radians(fov_deg) / 2))


def fov_deg(focal_length_px, width_px):
    """Convert a focal length to the horizontal field of view in degrees. Inverse of `focal_px`."""
    return np.degrees(2 * np.arctan(width_px / (2.0 * focal_length_px)))


def stereo_rms_m(distance_m, focal_times_baseline_px_m, subpixel_px=SUBPIXEL_PX):
    """RMS depth error at a distance, in metres: d^2 s / (f b)."""
    return np.asarray(distance_m, float) ** 2 * subpixel_px / focal_times_baseline_px_m
