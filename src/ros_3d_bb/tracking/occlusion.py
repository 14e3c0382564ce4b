"""Why a person is not seen: hidden by somebody or something, outside the camera's view, or gone."""
import numpy as np

from ros_3d_bb.tracking.types import OCCLUDED, OUT_OF_VIEW, VISIBLE

EDGE_RAD = 0.04  # people this close to the image border are not detected reliably
NEAREST_M = 0.45  # nor are people this close to the camera
LEAST_IN_IMAGE = 0.2  # share of the body axis that has to be in the image for a person to be detected
AXIS_SAMPLES = np.linspace(-0.48, 0.48, 11)  # points of the body axis that are looked for, in heights from the centre
BODY_RADIUS_M = 0.27
NEARER_M = 0.25  # who hides another person is nearer by so much
SEEN_BESIDE = 0.2  # and leaves so much of a half width to be seen, which is too narrow for a detector
HIDDEN_BEHIND_M = 0.5  # nearer by so much than the person, measured depth is that of something else
HIDDEN_SHARE = 0.5
ACROSS, ALONG = np.meshgrid((-0.6, 0, 0.6), (-0.8, -0.4, 0, 0.4, 0.8))  # where depth is asked for, in half extents


def classify_visibility(view, positions_m, sizes_m, others_m, farthest_m):
    """What the camera could see of the places where people are thought to be.

    Parameters
    ----------
    view : View
    positions_m, sizes_m : numpy.ndarray, (n, 3)
    others_m : numpy.ndarray, (m, 3)
        Where people are who may hide them; they themselves may be among those.
    farthest_m : float
        People farther away are not found.

    Returns
    -------
    numpy.ndarray of int, (n,)
        VISIBLE: should have been found there; OCCLUDED: hidden by somebody, or by something nearer in the depth image;
        OUT_OF_VIEW.
    """
    distances_m, bearings = view.bearings(positions_m)
    places = np.full(len(positions_m), VISIBLE)
    places[_behind_others(distances_m, bearings, *view.bearings(others_m))] = OCCLUDED
    if view.depth_at is not None:
        places[_behind_something(view, positions_m, sizes_m)] = OCCLUDED
    places[_out_of_view(view, positions_m, sizes_m, distances_m, bearings, farthest_m)] = OUT_OF_VIEW
    return places


def share_in_image(view, positions_m, heights_m, margin_rad=0.0):
    """How much of the axes of upright bodies the image of a camera shows, whatever hides them.

    Parameters
    ----------
    view : View
        Its intrinsics are known.
    positions_m : numpy.ndarray, (n, 3)
        Centres in the fixed frame.
    heights_m : numpy.ndarray, (n,)
    margin_rad : float
        Width of the strip along the image border that does not count, as an angle near the optical axis.

    Returns
    -------
    numpy.ndarray, (n,)
        0..1. Points to which the lens distortion gives no pixel are not in the image.
    """
    camera, rotation = view.intrinsics, view.fixed_from_camera[:3, :3]  # its inverse is its transpose
    centers = (positions_m - view.fixed_from_camera[:3, 3]).dot(rotation)
    points = centers[:, None] + (AXIS_SAMPLES * heights_m[:, None])[..., None] * rotation[2]
    in_front = points[..., 2] > 0
    points[..., 2][~in_front] = 1  # they have no pixel
    size = np.array([camera.width, camera.height])
    half_px = size / 2.0 - margin_rad * np.array([camera.fx, camera.fy])
    with np.errstate(invalid='ignore'):  # nan is outside
        inside = (np.abs(camera.project(points) - (size - 1) / 2.0) <= half_px).all(axis=-1)
    return (in_front & inside).mean(axis=1)


def depths_towards(camera, depth, points):
    """The depth measured in the direction of points, for `View`.

    Parameters
    ----------
    camera : camera_model.Camera
    depth : box3d_estimator.DepthImage
    points : numpy.ndarray, (k, 3)
        In the optical frame, metres.

    Returns
    -------
    numpy.ndarray, (k,)
        Metres along z; nan where none was measured, and outside the image.
    """
    in_front = points[:, 2] > 0
    pixels = camera.project(np.where(in_front[:, None], points, (0, 0, 1)))
    size = np.array([camera.width, camera.height])
    inside = in_front & np.isfinite(pixels).all(axis=1)
    pixels = np.rint(np.where(inside[:, None], pixels, 0)).clip(-1, size).astype(int)
    inside &= ((pixels >= 0) & (pixels < size)).all(axis=1)
    depths_m, measured = depth.at(*np.where(inside[:, None], pixels, 0).T)
    return np.where(inside & measured, depths_m, np.nan)


def _out_of_view(view, positions_m, sizes_m, distances_m, bearings, farthest_m):
    """Which people the camera cannot detect: too close, too far, or with too little of the body in the image."""
    above_m = np.abs(positions_m[:, 2] - view.fixed_from_camera[2, 3]) - sizes_m[:, 2] / 2
    distances_m = np.hypot(distances_m, np.maximum(above_m, 0))
    outside = (distances_m < NEAREST_M) | (distances_m > farthest_m)
    if view.intrinsics is None:
        return outside | (np.abs(bearings) > np.pi / 2)
    return outside | (share_in_image(view, positions_m, sizes_m[:, 2], EDGE_RAD) < LEAST_IN_IMAGE)


def _behind_others(distances_m, bearings, others_m, others_bearings):
    apart = np.abs(wrapped(others_bearings - bearings[:, None]))
    covered = apart < _half_widths(others_m) + SEEN_BESIDE * _half_widths(distances_m)[:, None]
    return (covered & (others_m < distances_m[:, None] - NEARER_M)).any(axis=1)


def wrapped(angles):
    """Angles from -pi to pi, radians."""
    return angles - 2 * np.pi * np.rint(angles / (2 * np.pi))


def _half_widths(distances_m):
    """Of bodies, in radians."""
    return np.arcsin(np.clip(BODY_RADIUS_M / np.maximum(distances_m, 0.01), 0, 1))


def _behind_something(view, positions_m, sizes_m):
    """Where most of the depth measured towards an upright body ends well before it."""
    rotation = view.fixed_from_camera[:3, :3]  # its inverse is its transpose
    centers = (positions_m - view.fixed_from_camera[:3, 3]).dot(rotation)
    right = rotation.T.dot((view.ahead[1], -view.ahead[0], 0))
    offsets = (sizes_m[:, :1] / 2 * ACROSS.ravel())[..., None] * right
    offsets += (sizes_m[:, 2:] / 2 * ALONG.ravel())[..., None] * rotation[2]  # up
    points = centers[:, None] + offsets
    depths_m = view.depth_at(points.reshape(-1, 3)).reshape(len(centers), ACROSS.size)
    known = np.isfinite(depths_m)
    nearer = known & (np.where(known, depths_m, 0) < points[..., 2] - HIDDEN_BEHIND_M)
    return nearer.sum(axis=1) > HIDDEN_SHARE * np.maximum(known.sum(axis=1), ACROSS.size / 3.0)
