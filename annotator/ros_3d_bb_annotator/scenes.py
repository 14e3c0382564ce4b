"""Texts and overlays of a measurement."""
from ros_3d_bb.estimation.box3d_estimator import estimator_named
from ros_3d_bb_annotator.document import ESTIMATOR
from ros_3d_bb_annotator.marking import MarkedBox, Scene


def scene_of(measurement, depth):
    """Overlay of a measurement. With a DepthImage it contains the samples of the estimator in each box."""
    boxes = tuple(MarkedBox(number, detection.box_px, _label_of(number, detection), detection.by_hand)
                  for number, detection in enumerate(measurement.detections) if detection.box_px is not None)
    sample = estimator_named(ESTIMATOR).sample
    samples = () if depth is None else tuple(
        sample(depth, box.rect_px) for box in boxes
        if box.rect_px[0] < box.rect_px[2] and box.rect_px[1] < box.rect_px[3])
    return Scene(boxes, measurement.person, samples)


def detection_text(number, detection):
    """Description of a detection in two lines."""
    position = 'no estimate' if detection.estimate_m is None else (
        'X %s  Z %.3f m' % (signed(detection.estimate_m[0]), detection.estimate_m[2]))
    details = (detection.support is not None and 'support %.0f %%' % (100 * detection.support),
               detection.truncated and 'truncated', detection.by_hand and 'drawn by hand')
    return '%d: %s\n     %s' % (number + 1, position, ', '.join(filter(None, details)))


def readout_text(cursor, depth, camera):
    """Text with pixel, depth and position at the cursor (u, v) or None. `depth` is a DepthImage or None."""
    if cursor is None:
        return 'Point at the image: pixel, depth, X Y Z'
    text = 'pixel (%d, %d)' % cursor
    if depth is None:
        return text
    depth_m, valid = depth.at(*cursor)
    if not valid:
        return text + '    no depth there'
    x_m, y_m, z_m = camera.deproject(cursor, depth_m).tolist()
    return text + '    depth %.3f m    X %s  Y %s  Z %.3f m' % (depth_m, signed(x_m), signed(y_m), z_m)


def signed(value_m):
    """Format metres with a sign, with a minus sign as wide as the plus sign."""
    return ('%+.3f' % value_m).replace('-', '−')


def _label_of(number, detection):
    return '%d' % (number + 1) + ('' if detection.estimate_m is None else ': %.2f m' % detection.estimate_m[2])
