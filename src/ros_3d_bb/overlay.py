"""Draw what the pipeline saw into images. Images are (height, width, 3), uint8, RGB, and drawn on in place."""
import cv2
import numpy as np

BOX_COLOR, TEXT_COLOR = (40, 220, 60), (0, 0, 0)
OUTSIDE_PX = 4  # where an edge is drawn that nobody sees
VALID_COLOR, INVALID_COLOR, CORNER_COLOR = (255, 0, 0), (0, 0, 255), (160, 32, 240)


def draw_boxes(image, boxes, labels):
    """Draw 2D boxes (n, 4) with a label each, which may be empty. Returns the image."""
    height, width = image.shape[:2]
    # OpenCV walks along all of an edge, also where that is outside: an edge of 2^31 pixels takes it a tenth of a second
    seen = np.clip(np.reshape(boxes, (-1, 4)), -OUTSIDE_PX, [width + OUTSIDE_PX, height + OUTSIDE_PX] * 2)
    for box, label in zip(np.rint(seen).astype(int).tolist(), labels):
        cv2.rectangle(image, tuple(box[:2]), tuple(box[2:]), BOX_COLOR, 2)
        if not label:
            continue
        (across, above), below = cv2.getTextSize(label, cv2.FONT_HERSHEY_SIMPLEX, 0.5, 1)
        top = max(box[1], above + below)  # inside the image, where the box begins above it
        cv2.rectangle(image, (box[0], top - above - below), (box[0] + across, top), BOX_COLOR, cv2.FILLED)
        cv2.putText(image, label, (box[0], top - below // 2 - 1), cv2.FONT_HERSHEY_SIMPLEX, 0.5, TEXT_COLOR, 1,
                    cv2.LINE_AA)
    return image


def draw_caption(image, text):
    """Write a line into the upper left corner. Returns the image."""
    return cv2.putText(image, text, (8, 24), cv2.FONT_HERSHEY_SIMPLEX, 0.8, TEXT_COLOR, 2, cv2.LINE_AA)


def draw_samples(image, rect_px, samples):
    """Draw the depth samples of a box as in the thesis' Fig. 3.5. Returns the image.

    Red: depth measured; blue: no depth there; purple: the box's corners.
    """
    height, width = image.shape[:2]
    x1, y1, x2, y2 = np.clip(rect_px, 0, [width, height] * 2).tolist()
    for corner in ((x1, y1), (x2, y2)):
        cv2.circle(image, corner, 5, CORNER_COLOR, 2)
    for (u, v), valid in zip(samples.pixels.reshape(-1, 2).tolist(), samples.valid.ravel().tolist()):
        cv2.circle(image, (u, v), 2, VALID_COLOR if valid else INVALID_COLOR, cv2.FILLED)
    return image


def visible_depth(depth, farthest_m):
    """A depth image to look at: (height, width), uint8, from near (bright) to `farthest_m` (dark); 0 is no depth."""
    depth_m = depth.values.astype(np.float32) * np.float32(depth.scale_m)
    measured = np.isfinite(depth_m) & (depth_m > 0)
    grey = 255 - 254 * np.clip(np.where(measured, depth_m, 0) / farthest_m, 0, 1)
    return np.where(measured, grey, 0).astype(np.uint8)


def colors_of(grey):
    """Colours of a depth image as `visible_depth` makes it: near is red, far blue, not measured black."""
    colors = np.ascontiguousarray(cv2.applyColorMap(grey, cv2.COLORMAP_JET)[..., ::-1])
    colors[grey == 0] = 0
    return colors
