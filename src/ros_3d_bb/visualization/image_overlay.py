"""Overlays of the pipeline's results on images. Images are (height, width, 3), uint8, RGB, and modified in place.

OpenCV is imported only where it is used: it takes 100 MB, and most nodes draw images only while they have subscribers.
"""
import numpy as np

BOX_COLOR, TEXT_COLOR = (40, 220, 60), (0, 0, 0)
OUTSIDE_PX = 4  # edges outside the image are drawn at this distance from it
VALID_COLOR, INVALID_COLOR, CORNER_COLOR = (255, 140, 0), (0, 90, 255), (160, 32, 240)
DEPTH_RANGE_M = 6.0  # default of the far end of the colours of depth


def draw_boxes(image, boxes, labels):
    """Draw 2D boxes (n, 4) with labels, which may be empty, and are moved where they overlap. Returns the image."""
    import cv2
    height, width = image.shape[:2]
    # OpenCV also iterates over the parts of edges outside the image: an edge of 2^31 pixels takes a tenth of a second.
    clipped = np.clip(np.reshape(boxes, (-1, 4)), -OUTSIDE_PX, [width + OUTSIDE_PX, height + OUTSIDE_PX] * 2)
    corners, taken = np.rint(clipped).astype(int).tolist(), []
    for box in corners:
        cv2.rectangle(image, tuple(box[:2]), tuple(box[2:]), BOX_COLOR, 2)
    for box, label in zip(corners, labels):
        if not label:
            continue
        (text_width, text_height), baseline = cv2.getTextSize(label, cv2.FONT_HERSHEY_SIMPLEX, 0.5, 1)
        left, right, line = box[0], box[0] + text_width, text_height + baseline
        bottom = max(box[1], line)  # inside the image, even if the box starts above it
        for other_left, other_right, other_bottom in sorted(taken, key=lambda other: other[2]):
            if left < other_right and right > other_left and abs(bottom - other_bottom) < line:
                bottom = other_bottom + line
        taken.append((left, right, bottom))
        cv2.rectangle(image, (left, bottom - line), (right, bottom), BOX_COLOR, cv2.FILLED)
        cv2.putText(image, label, (left, bottom - baseline // 2 - 1), cv2.FONT_HERSHEY_SIMPLEX, 0.5, TEXT_COLOR, 1,
                    cv2.LINE_AA)
    return image


def draw_caption(image, text):
    """Draw a line of text in the upper left corner. Returns the image."""
    import cv2
    return cv2.putText(image, text, (8, 24), cv2.FONT_HERSHEY_SIMPLEX, 0.8, TEXT_COLOR, 2, cv2.LINE_AA)


def draw_samples(image, rect_px, samples):
    """Draw the depth samples of a box as in Fig. 3.5 of the thesis. Returns the image.

    Orange: valid depth; blue: no depth; purple: corners of the box.
    """
    import cv2
    height, width = image.shape[:2]
    x1, y1, x2, y2 = np.clip(rect_px, 0, [width, height] * 2).tolist()
    for corner in ((x1, y1), (x2, y2)):
        cv2.circle(image, corner, 5, CORNER_COLOR, 2)
    for (u, v), valid in zip(samples.pixels.reshape(-1, 2).tolist(), samples.valid.ravel().tolist()):
        cv2.circle(image, (u, v), 2, VALID_COLOR if valid else INVALID_COLOR, cv2.FILLED)
    return image


def depth_to_grey(depth, farthest_m):
    """Convert a depth image to grey levels (h, w), uint8: 255 to 1 for depth from 0 to `farthest_m`, 0 without depth.
    """
    depth_m = depth.values.astype(np.float32) * np.float32(depth.scale_m)
    with np.errstate(invalid='ignore'):  # nan
        valid = np.isfinite(depth_m) & (depth_m > 0)
    grey = 255 - 254 * np.clip(np.where(valid, depth_m, 0) / farthest_m, 0, 1)
    return np.where(valid, grey, 0).astype(np.uint8)


def colorize_depth(grey):
    """Convert the output of `depth_to_grey` to colours: near is yellow, far is dark blue, no depth is black."""
    import cv2
    colors = np.ascontiguousarray(cv2.applyColorMap(grey, cv2.COLORMAP_PARULA)[..., ::-1])
    colors[grey == 0] = 0
    return colors
