"""Conversion of images to batches, the inputs of networks."""
import cv2
import numpy as np


RGB, BGR = (0, 1, 2), (2, 1, 0)  # orders of the channels of an RGB image


def batch_of(image, order=RGB, mean=(0.0, 0.0, 0.0), std=(255.0, 255.0, 255.0), dtype=np.float32):
    """Convert an RGB image (height, width, 3), uint8, to a batch (1, 3, height, width) of (value - mean) / std.

    `order` is that of the channels in the batch, in mean and in std.
    """
    batch, channels = np.empty((1, 3) + image.shape[:2], dtype), cv2.split(image)
    for plane, number, mean_value, std_value in zip(batch[0], order, mean, std):
        plane[...] = channels[number]
        if mean_value != 0:
            plane -= dtype(mean_value)
        if std_value != 1:
            plane /= dtype(std_value)
    return batch
