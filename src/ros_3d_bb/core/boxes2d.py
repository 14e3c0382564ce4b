"""The 2D boxes of one image, as bbox3d_node receives them."""
from typing import NamedTuple, Optional, Tuple

import numpy as np


class Boxes2D(NamedTuple):
    """The 2D boxes of one image: (n, 4) integer pixels x1, y1, x2, y2, and the stamp and frame of the image.

    `stamp_ns` is None for a plain array, which does not identify its image. `labels` are the class names of the boxes;
    `scores` (n,) are 0..1, 0 if unknown. `image_size` is the (width, height) of the image, None if unknown. `color` is
    the image, RGB (height, width, 3), if it is known.
    """

    boxes: np.ndarray
    stamp_ns: Optional[int]
    frame_id: str
    labels: Tuple[str, ...]
    scores: np.ndarray
    image_size: Optional[Tuple[int, int]] = None
    color: Optional[np.ndarray] = None
