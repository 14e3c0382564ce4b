"""What the geometry of a stereo camera says about its depth error (thesis 5.2)."""
import numpy as np

SUBPIXEL_PX = 0.08  # matching error that Intel gives for the D435 (thesis 5.2)
THESIS_FOV_DEG, THESIS_WIDTH_PX, THESIS_BASELINE_M = 69.0, 640, 0.05
# Of the thesis' D435i, read from its depth images: all depths are 610.14 m / n with whole n, 1/32 pixel of disparity.
STEREO_PX_M = 19.067
COLOR_FOCAL_PX = 614.686  # of the thesis' colour camera at 640x480, to which its depth images are aligned


def focal_px(fov_deg, width_px):
    """Focal length in pixels of an image so wide with a horizontal field of view. Inverse of `fov_deg`."""
    return width_px / (2 * np.tan(np.radians(fov_deg) / 2))


def fov_deg(focal_length_px, width_px):
    """Horizontal field of view of an image, degrees. Inverse of `focal_px`."""
    return np.degrees(2 * np.arctan(width_px / (2.0 * focal_length_px)))


def stereo_rms_m(distance_m, focal_times_baseline_px_m, subpixel_px=SUBPIXEL_PX):
    """Root mean square of the depth error at a distance: d^2 s / (f b), metres."""
    return np.asarray(distance_m, float) ** 2 * subpixel_px / focal_times_baseline_px_m
