"""The images of a camera at one stamp, as detection and estimation use them: registered and upright."""
from typing import Any, NamedTuple, Optional

import numpy as np

from ros_3d_bb.camera.camera_model import Camera
from ros_3d_bb.camera.image_rotation import (turned_boxes, turned_camera, turned_depth, turned_image, turned_rotation,
                                             turns_for)


class RgbdFrame(NamedTuple):
    """A depth image with the pixels of the colour image, both upright.

    The optical frame of the upright image is that of the received image, turned about the optical axis.
    """

    stamp_ns: int  # of the colour image
    depth_stamp_ns: int
    frame_id: str  # optical frame of the received image
    camera: Camera  # of the upright image
    depth: Any  # DepthImage or RegisteredDepth
    depth_unit_m: float  # metres per unit of the received depth image
    color: Optional[np.ndarray] = None  # RGB (height, width, 3), uint8
    turns: int = 0  # clockwise quarter turns from the received to the upright image
    camera_from_floor: Optional[np.ndarray] = None  # (4, 4), optical frame of the upright image from ~floor_frame

    @property
    def up(self):
        """Unit vector that points up, in the optical frame of the upright image, as a tuple; None if it is unknown."""
        return None if self.camera_from_floor is None else tuple(self.camera_from_floor[:3, 2].tolist())

    @property
    def received_camera(self):
        """The Camera of the received image."""
        return turned_camera(self.camera, -self.turns)

    @property
    def received_depth(self):
        """The depth image with the pixels of the received colour image."""
        return turned_depth(self.depth, -self.turns)

    @property
    def received_color(self):
        """The colour image as received."""
        return turned_image(self.color, -self.turns)

    def upright_rects(self, rects_px):
        """Rectangles (n, 4) of the received image in the upright image. Inverse of `received_rects`."""
        return turned_boxes(rects_px, self.turns, *self.received_camera[:2]) if self.turns else rects_px

    def received_rects(self, rects_px):
        """Rectangles (n, 4) of the upright image in the received image."""
        return turned_boxes(rects_px, -self.turns, *self.camera[:2])


def upright_frame(frame, image_rotation):
    """Turn a RgbdFrame, as received, upright; `image_rotation` is as for `image_rotation.turns_for`."""
    turns = turns_for(image_rotation, frame.up)
    if not turns:
        return frame
    camera_from_floor = frame.camera_from_floor
    if camera_from_floor is not None:
        camera_from_floor = camera_from_floor.copy()
        camera_from_floor[:3] = turned_rotation(turns).dot(camera_from_floor[:3])
    return frame._replace(camera=turned_camera(frame.camera, turns), depth=turned_depth(frame.depth, turns),
                          color=None if frame.color is None else turned_image(frame.color, turns), turns=turns,
                          camera_from_floor=camera_from_floor)
