"""tf2 buffer that is filled from the messages of a bag."""
import genpy
import numpy as np
from tf2_msgs.msg import TFMessage

from ros_3d_bb.conversions.camera_msgs import transform_messages
from ros_3d_bb.conversions.perception_msgs import check_transforms
from ros_3d_bb.pipeline.transform_buffer import TransformBuffer


class BagTransforms(TransformBuffer):
    """tf2 buffer without ROS."""

    def add(self, message: TFMessage) -> None:
        """Add a message of tf. Raises ValueError if a stamp exceeds the range of tf2."""
        check_transforms(message)
        for transform in message.transforms:
            self.set_transform(transform, 'bag')

    def add_static(self, message: TFMessage) -> None:
        """Add a message of tf_static, which is valid for the whole bag. Raises ValueError as `add`."""
        check_transforms(message)
        for transform in message.transforms:
            self.set_transform_static(transform, 'bag')

    def set_pose(self, target_frame: str, frame: str, target_from_frame: np.ndarray) -> None:
        """Set the pose (4, 4) of a frame in a frame that tf does not contain, by a transform to the root of its tree.

        Raises ValueError if the transforms already contain the frame in `target_frame`.
        """
        self.add_static(TFMessage(transform_messages(genpy.Time(0), [
            self.link_to_root(target_frame, frame, target_from_frame)])))
