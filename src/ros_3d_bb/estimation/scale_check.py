"""Check of the scale of depth images by the heights of people."""
from collections import deque

import numpy as np

from ros_3d_bb.core.object_classes import PERSON, PERSON_CLASS

LATEST = 20  # people that must agree
LEAST_SUPPORT = 0.3  # boxes with less are often those of other objects
LEAST_ASPECT = 2.5  # height / width of the 2D box of a person who stands; less for seated or hidden people
HEIGHTS_M = (0.8, 2.4)  # plausible: a child below a camera whose tilt of 45 degrees is unknown, and a tall adult
COMMON_FACTORS = np.array([0.001, 0.01, 0.1, 0.2, 5, 10, 100, 1000])  # 0.2: 5000 units per metre, as in TUM RGB-D
NEAR = 1.4  # ratio of a factor and a common one that it stands for


class ScaleCheck(object):
    """Heights of the latest people. People who are partly hidden, truncated or not standing are not counted, nor are
    other objects.

    Three quarters of the heights must be too large, or too small.
    """

    def __init__(self):
        self._heights_m = deque(maxlen=LATEST)

    def factor(self, boxes):
        """Add the `Box3D`s of one image, plausible or not.

        Returns
        -------
        float or None
            Factor by which depth must be multiplied to give people the usual height; a common factor if one is near.
            None if the heights are possible or too few. After a factor, new people are collected.
        """
        self._heights_m.extend(float(box.size_m[1]) for box in boxes if _shows_standing_person(box))
        if len(self._heights_m) < LATEST:
            return None
        lower_m, median_m, upper_m = sorted(self._heights_m)[LATEST // 4::LATEST // 4]
        if upper_m >= HEIGHTS_M[0] and lower_m <= HEIGHTS_M[1]:
            return None
        self._heights_m.clear()
        factor = PERSON_CLASS.height / median_m
        ratios = np.abs(np.log(COMMON_FACTORS / factor))
        return float(COMMON_FACTORS[ratios.argmin()] if ratios.min() < np.log(NEAR) else '%.2g' % factor)


def _shows_standing_person(box):
    x1, y1, x2, y2 = box.rect_px
    is_supported = box.support >= LEAST_SUPPORT or box.size_m[1] > HEIGHTS_M[1]  # a giant is deeper than a body's layer
    return box.label == PERSON and not box.truncated and is_supported and y2 - y1 >= LEAST_ASPECT * (x2 - x1)
