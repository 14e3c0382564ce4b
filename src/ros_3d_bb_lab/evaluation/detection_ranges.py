"""People found by networks at longer ranges than those of a session: its images are shrunk as if it were farther away.

Shrinking imitates the size of people in the image, but neither noise nor light of longer ranges.
"""
import cv2
import numpy as np

from ros_3d_bb.detection.boxes import iou
from ros_3d_bb.detection.network_detector import GREY
from ros_3d_bb.sessions.session_reader import read_color

NEAREST_M = 1.9  # people of the session that are nearer are cut by the border of the image


def found_at_ranges(frames, camera, networks, ranges_m, found_iou):
    """Number of people that networks find at some ranges, {name: {'people': n, 'at 4 m': n, ...}}.

    `frames` have recorded boxes; those with ground truth at `NEAREST_M` or more are used, or a ValueError raised if
    there are none. `networks` are NetworkDetectors by name.
    """
    frames = [frame for frame in frames if frame.truth_m is not None and frame.truth_m[2] >= NEAREST_M]
    if not frames:
        raise ValueError('the session has no people with ground truth at %.1f m or more' % NEAREST_M)
    rows = {name: dict({'people': len(frames)}, **{'at %g m' % range_m: 0 for range_m in ranges_m})
            for name in networks}
    for frame in frames:
        image, box = read_color(frame, camera), frame.boxes_px[0]
        for range_m in ranges_m:
            shrunk, shrunk_box = shrink(image, box, min(1.0, frame.truth_m[2] / range_m))
            for name, network in networks.items():
                found = iou(shrunk_box, network.detect(shrunk).boxes)
                rows[name]['at %g m' % range_m] += bool((found >= found_iou).any())
    return rows


def shrink(image, box, scale):
    """Shrink an image (height, width, 3) and a box (4,) in it, and put it into the middle of a grey image of its size.
    """
    height, width = image.shape[:2]
    small = cv2.resize(image, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
    top, left = (height - small.shape[0]) // 2, (width - small.shape[1]) // 2
    shrunk = np.full_like(image, GREY)
    shrunk[top:top + small.shape[0], left:left + small.shape[1]] = small
    return shrunk, np.array(box, float) * scale + [left, top, left, top]
