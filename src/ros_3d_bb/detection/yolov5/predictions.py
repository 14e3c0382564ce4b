"""Inputs and outputs of YOLOv5 networks as numpy arrays.

Predictions are rows (5 + classes): x, y, width, height in pixels of the image, objectness, class scores. The heads of a
network, one per scale, contain the same predictions before decoding.
"""
import numpy as np

from ros_3d_bb.detection.onnx.decoders import decode_rows


class Backend(object):
    """Base of the backends. They are called with an RGB image (height, width, 3), uint8, and a minimum objectness, and
    return the predictions above it, float32.
    """

    input_hw, padding, suppressed = None, 'center', False

    def candidates(self, image, confidence):
        """Detections in an image with a score above the confidence, see `network_detector.NetworkDetector`."""
        rows = self(image, confidence)
        return decode_rows([rows[None]], image.shape[:2], rows.shape[1] - 5, confidence)


def check_stride(stride):
    if not 1 <= int(stride) <= 1024:
        raise ValueError('its stride is %s; 1 to 1024 expected' % stride)
    return int(stride)


def reference_image(stride):
    """Noise image, 2 strides high and 3 strides wide, for the comparison of backends."""
    return np.random.RandomState(0).randint(0, 256, (2 * stride, 3 * stride, 3)).astype(np.uint8)


def decode_heads(heads, anchors_px, strides, min_objectness):
    """Predictions of the heads of a network, without those whose objectness is not above `min_objectness`.

    For each scale there is a head (1, anchors * (5 + classes), lines, columns), float32 or float16, before the sigmoid;
    the width and height of its anchors in pixels, (anchors, 2); and its stride, the pixels per cell. Predictions are
    float32, ordered by scale, anchor, line and column as in YOLOv5.
    """
    with np.errstate(divide='ignore'):
        min_logit = np.log(np.clip(min_objectness, 0, 1) / np.float64(1 - np.clip(min_objectness, 0, 1)))
    with np.errstate(over='ignore'):  # of the sigmoid, which is 0 for large negative values
        return np.concatenate([_decode_head(*scale, min_logit) for scale in zip(heads, anchors_px, strides)])


def _decode_head(head, anchors_px, stride, min_logit):
    values = head.reshape((len(anchors_px), -1) + head.shape[2:])
    anchor, line, column = np.nonzero(values[:, 4] > min_logit)
    rows = 1 / (1 + np.exp(-values[anchor, :, line, column].astype(np.float32)))
    rows[:, :2] = (rows[:, :2] * 2 - 0.5 + np.stack((column, line), axis=1)) * stride
    rows[:, 2:4] = (rows[:, 2:4] * 2) ** 2 * anchors_px[anchor]
    return rows
