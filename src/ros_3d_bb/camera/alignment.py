"""Checks whether the depth image is aligned to the colour image, and whether tracks are in a suitable frame.

Each returns a description of the fault, empty without one. `color` and `depth` are `camera_model.Camera`.
"""
from typing import Optional, Tuple

import numpy as np

from ros_3d_bb.camera.camera_model import Camera
from ros_3d_bb.camera.images import FARTHEST_M, DepthImage

LOOKS_UP = 0.85  # z component of a viewing direction from which on it is none, about 60 degrees; chosen
SAME_PX = 1.0  # intrinsics that differ by less count as equal: half a pixel is 1 cm at 6 m
ALIGN = ('start the camera with realsense.launch, or realsense2_camera with align_depth:=true, and use '
         'camera/aligned_depth_to_color/image_raw, or pass depth:=raw, which registers raw depth')
POSE = ('set it to a frame whose z axis points up (map, odom), and publish the pose of the camera in that frame; for a '
        'camera alone, pass its height and tilt (camera_height:=, camera_tilt:=; process_bag: --camera-height, '
        '--camera-tilt)')

# Comparison of edges. Zoom of depth about the middle of the image, and shift of points at 1 m, in image widths.
ZOOMS, SHIFTS = np.linspace(0.55, 1.8, 26), np.linspace(-0.095, 0.095, 39)
ROWS, SIDE_PX = 4, 2  # every so many rows are used; distance of the pixels on both sides of an edge
MIN_JUMP, JUMPS_M = 0.15, (0.5, 6.0)  # smallest edge, as a share of the nearer depth, and range of that depth
FULL_CHANGE = 40.0  # change of colour, of 255, that counts fully
MIN_EDGES, MAX_EDGES = 60, 600  # in an image
MIN_IMAGES, MOVED = 4, 0.01  # images, between which the mean of the edges has moved by this share of the image width
MIN_BETTER, MIN_BETTER_STDS = 0.15, 3.0  # how much higher the maximum must be than the share of aligned depth


def size_fault(color: Camera, width: int, height: int) -> str:
    if (width, height) == color[:2]:
        return ''
    return 'the depth image has %d x %d pixels, the colour camera %d x %d' % ((width, height) + color[:2])


def info_size_fault(camera: Camera, width: int, height: int, info_topic: str) -> str:
    if (width, height) == camera[:2]:
        return ''
    return ('the colour image has %d x %d pixels, its camera_info on %s is for %d x %d: remap the camera_info of this '
            'image' % (width, height, info_topic, camera.width, camera.height))


def intrinsics_fault(color: Camera, depth: Camera) -> str:
    """Compare the intrinsics of both cameras, with the tolerance `SAME_PX`."""
    if color[:2] != depth[:2]:
        return size_fault(color, depth.width, depth.height)
    if max(abs(mine - other) for mine, other in zip(color[2:6], depth[2:6])) > SAME_PX:
        return ('the intrinsics fx fy cx cy of depth are %.1f %.1f %.1f %.1f, those of colour %.1f %.1f %.1f %.1f'
                % (depth[2:6] + color[2:6]))
    return ''


def frames_fault(color_frame: str, depth_frame: str) -> str:
    """Compare the frame_ids of both images; an empty one is unknown."""
    if color_frame and depth_frame and color_frame.lstrip('/') != depth_frame.lstrip('/'):
        return 'the depth image is in the frame %s, the colour camera in %s' % (depth_frame, color_frame)
    return ''


def is_optical(frame_id: str) -> bool:
    """Whether a frame is an optical frame by its name (REP 103): its z axis is the viewing direction."""
    return frame_id.endswith('optical_frame')


def target_frame_fault(target_frame: str, camera_frame: str = '') -> str:
    """Check that the frame of the tracks is no optical frame: neither by its name nor that of the 3D boxes."""
    target_frame = target_frame.lstrip('/')
    if is_optical(target_frame) or target_frame == camera_frame.lstrip('/'):
        return ('the target frame %s is an optical frame: its z axis is the viewing direction, but tracks need one '
                'that points up' % target_frame)
    return ''


def viewing_fault(camera_frame: str, target_from_camera: np.ndarray) -> str:
    """Check the pose (4, 4) of a camera in a frame whose z axis points up: no camera that sees people looks up steeply,
    but the z axis of its body does, if the images have that frame instead of the optical one.
    """
    if target_from_camera[2, 2] < LOOKS_UP:
        return ''
    return ('by tf, the frame %s of the images is no optical frame (x right, y down, z forward): the camera would look '
            'up by %.0f degrees' % (camera_frame, np.degrees(np.arcsin(min(target_from_camera[2, 2], 1.0)))))


class EdgeComparison(object):
    """Recognises depth that is not aligned to colour although size and frame agree: their edges disagree.

    Where depth jumps, colour usually changes. The share of the depth edges at which it does is compared with the share
    for depth that is enlarged and seen from beside, for a grid of both. Depth that is not aligned has a clear maximum
    elsewhere on this grid, and aligned depth one here. Only images in which something has moved are used: in a single
    one, edges may agree by chance. In a bare room there are no edges, and there is no answer.
    """

    def __init__(self) -> None:
        self._hits = self._count = np.zeros((len(ZOOMS), len(SHIFTS)))
        self._images, self._middle_px = 0, -np.inf

    def add(self, color: np.ndarray, depth: DepthImage) -> None:
        """Add an RGB image (h, w, 3) and the DepthImage of the same time. Other sizes are ignored."""
        if color.shape[:2] != depth.shape:
            return
        u, v, near_m = _depth_edges(depth)
        if len(u) < MIN_EDGES or abs(u.mean() - self._middle_px) < MOVED * color.shape[1]:
            return
        self._images, self._middle_px = self._images + 1, u.mean()
        chosen = np.linspace(0, len(u) - 1, min(len(u), MAX_EDGES)).astype(int)
        hits, count = _hits(u[chosen], v[chosen], near_m[chosen], _color_changes(color))
        self._hits, self._count = self._hits + hits, self._count + count

    def fault(self) -> Optional[str]:
        """Return a sentence if the edges of depth and colour disagree, '' if they agree, and None if the images do not
        show it."""
        if self._images < MIN_IMAGES:
            return None
        shares = self._hits / np.maximum(self._count, 1)
        shares[self._count < 0.5 * self._count.max()] = 0  # outside of the image
        zoom, shift = np.abs(ZOOMS - 1).argmin(), np.abs(SHIFTS).argmin()
        aligned = shares[zoom - 1:zoom + 2, shift - 1:shift + 2].max()
        best_zoom, best_shift = np.unravel_index(shares.argmax(), shares.shape)
        clear = max(MIN_BETTER, MIN_BETTER_STDS * shares.std())
        if shares.max() - aligned < clear:
            return '' if aligned - shares.mean() > clear else None
        return ('the edges of depth and colour disagree: they fit if depth is enlarged %.2f times and shifted by '
                '%.0f %% of the image width at 2 m' % (ZOOMS[best_zoom], 100 * SHIFTS[best_shift] / 2))


def _depth_edges(depth: DepthImage) -> Tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Columns, rows and nearer depth, metres, of the jumps of depth along some rows; gaps beside them are closed."""
    depth_m = depth.values[ROWS // 2::ROWS].astype(np.float32) * np.float32(depth.scale_m)
    with np.errstate(invalid='ignore'):
        measured = (depth_m > 0) & (depth_m <= FARTHEST_M)
    columns = np.arange(depth_m.shape[1])
    before = np.maximum.accumulate(np.where(measured, columns, 0), axis=1)
    after = np.minimum.accumulate(np.where(measured, columns, columns[-1])[:, ::-1], axis=1)[:, ::-1]
    depth_m = np.where(measured, depth_m, 0)
    lines = np.arange(len(depth_m))[:, None]
    filled_m = np.maximum(depth_m[lines, before], depth_m[lines, after])
    left_m, right_m = filled_m[:, :-2 * SIDE_PX], filled_m[:, 2 * SIDE_PX:]
    near_m = np.minimum(left_m, right_m)
    is_jump = (np.abs(left_m - right_m) > MIN_JUMP * near_m) & (near_m > JUMPS_M[0]) & (near_m < JUMPS_M[1])
    is_jump = np.pad(is_jump, ((0, 0), (1, 1)), 'constant')
    rows, first = np.nonzero(is_jump[:, 1:-1] & ~is_jump[:, :-2])
    _rows, last = np.nonzero(is_jump[:, 1:-1] & ~is_jump[:, 2:])
    sharp = last - first <= 4 * SIDE_PX
    rows, first, last = rows[sharp], first[sharp], last[sharp]
    return (first + last) / 2.0 + SIDE_PX, rows * float(ROWS) + ROWS // 2, near_m[rows, first]


def _color_changes(color: np.ndarray) -> np.ndarray:
    """Change of green along the rows (h, w), 0..1; saturated, so that strong edges do not prevail."""
    green = color[..., 1].astype(np.int16)
    changes = np.zeros(green.shape, np.float32)
    changes[:, SIDE_PX:-SIDE_PX] = np.abs(green[:, 2 * SIDE_PX:] - green[:, :-2 * SIDE_PX])
    return np.minimum(changes / FULL_CHANGE, 1)


def _hits(u: np.ndarray, v: np.ndarray, near_m: np.ndarray, changes: np.ndarray) -> Tuple[np.ndarray, np.ndarray]:
    """Sums of the changes of colour at depth edges, and numbers of edges in the image, for each zoom and shift."""
    height, width = changes.shape
    shifts_px = SHIFTS[:, np.newaxis] * width / near_m
    hits, count = np.zeros((2, len(ZOOMS), len(SHIFTS)))
    for number, zoom in enumerate(ZOOMS):
        columns = np.rint(width / 2.0 + zoom * (u - width / 2.0) + shifts_px).astype(int)
        rows = np.broadcast_to(np.rint(height / 2.0 + zoom * (v - height / 2.0)).astype(int), columns.shape)
        inside = (columns >= 0) & (columns < width) & (rows >= 0) & (rows < height)
        found = changes[np.where(inside, rows, 0), np.where(inside, columns, 0)]
        hits[number], count[number] = np.where(inside, found, 0).sum(axis=1), inside.sum(axis=1)
    return hits, count
