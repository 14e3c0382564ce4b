"""What goes into a YOLOv5 network and what comes out of it, as numpy arrays.

Predictions are rows (5 + classes): x, y, width, height in pixels of the image, objectness, class scores. A network
ends in heads, one for each scale, which hold the same numbers before they are decoded.
"""
import numpy as np


def batch_of(image):
    """An RGB image (height, width, 3), uint8, as the batch (1, 3, height, width), float32, 0..1."""
    batch = np.ascontiguousarray(image.transpose(2, 0, 1)[None], np.float32)
    batch /= 255
    return batch


def checked_stride(stride):
    """A stride as a positive int. Raises ValueError."""
    if not 1 <= int(stride) <= 1024:
        raise ValueError('its stride is %s' % stride)
    return int(stride)


def predictions(output):
    """The predictions (rows, 5 + classes) of the one image in an output (1, rows, 5 + classes).

    Raises
    ------
    ValueError
        If the output has another shape: the model is no YOLOv5 detector.
    """
    if len(output.shape) != 3 or output.shape[0] != 1 or output.shape[2] < 6:
        raise ValueError('its output has shape %s; (1, rows, 5 + classes) expected' % (tuple(output.shape),))
    return output[0]


def decoded_heads(heads, anchors_px, strides, least):
    """The predictions in the heads of a network; only those above the least objectness are decoded.

    Parameters
    ----------
    heads : list of numpy.ndarray, (1, anchors * (5 + classes), lines, columns), float32
        One for each scale, before the sigmoid.
    anchors_px : numpy.ndarray, (scales, anchors, 2)
        Width and height in pixels.
    strides : list of int
        Pixels by cell of each scale.
    least : float
        Objectness, 0..1.

    Returns
    -------
    numpy.ndarray, (rows, 5 + classes), float32
        By scale, anchor, line and column, as YOLOv5 orders them.
    """
    with np.errstate(divide='ignore'):
        least_logit = np.log(np.clip(least, 0, 1) / np.float64(1 - np.clip(least, 0, 1)))
    return np.concatenate([_decoded_head(*scale, least_logit) for scale in zip(heads, anchors_px, strides)])


def _decoded_head(head, anchors_px, stride, least_logit):
    values = head.reshape((len(anchors_px), -1) + head.shape[2:])
    anchor, line, column = np.nonzero(values[:, 4] > least_logit)
    with np.errstate(over='ignore'):  # far below zero, where the result is 0
        rows = 1 / (1 + np.exp(-values[anchor, :, line, column]))
    rows[:, :2] = (rows[:, :2] * 2 - 0.5 + np.stack((column, line), axis=1)) * stride
    rows[:, 2:4] = (rows[:, 2:4] * 2) ** 2 * anchors_px[anchor]
    return rows
