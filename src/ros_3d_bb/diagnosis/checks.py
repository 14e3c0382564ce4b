"""Checks of a graph or a bag, in the order of the pipeline, so that the first fault found is the likely cause.

A check is skipped if its input is missing: without depth images, for example, their unit is not checked.
"""
from ros_3d_bb.camera.alignment import ALIGN, frames_fault, intrinsics_fault, size_fault
from ros_3d_bb.diagnosis.observations import Finding
from ros_3d_bb.diagnosis.tf_tree import why_missing
from ros_3d_bb.diagnosis.topic_faults import (LATE_S, LEAST_PAIRED, LEAST_RATE_HZ, STANDSTILL, clock_fault,
                                              paired_share, silence_fault, span)

COLOR, DEPTH, INFO, BOXES2D, BOXES3D, TRACKS = 'color', 'depth', 'info', 'boxes2d', 'boxes3d', 'tracks'
IMAGES = COLOR, DEPTH, INFO


def findings(seen):
    """Run all checks.

    Parameters
    ----------
    seen : Observations

    Returns
    -------
    list of Finding
        Both faults and passed checks.
    """
    found = _clock(seen)
    has_boxes_only = seen.is_bag and has_come(seen, BOXES2D) and not has_come(seen, COLOR)
    found += [_stream(seen, key) for key in IMAGES if not (has_boxes_only and key == COLOR)]
    found += _camera(seen) + _alignment(seen) + _encodings(seen) + _stamps(seen) + _pairs_of_images(seen)
    found += _transforms(seen) + _detector(seen) + _pairs_of_boxes(seen) + _results(seen)
    return found + _nodes(seen, any(finding.is_wrong for finding in found))


def has_come(seen, key):
    """Whether messages of the correct type arrived on the topic of a role."""
    return key in seen.streams and seen.streams[key].count > 0


def _judged(subject, fact, fault='', fix=''):
    return Finding(subject, '' if fault else fact, fault, fix)


def _clock(seen):
    if seen.clock is None:
        return []
    if seen.clock.use_sim_time and not seen.clock.count:
        return [Finding('time', '', *STANDSTILL)]
    if seen.clock.count and not seen.clock.use_sim_time:
        return [Finding('time', fault='somebody publishes /clock, and /use_sim_time is not set: nodes do not heed it',
                        fix='rosparam set use_sim_time true before the nodes start')]
    return [Finding('time', 'from /clock' if seen.clock.use_sim_time else "the machine's clock")]


def _stream(seen, key):
    stream = seen.streams[key]
    if not stream.count:
        taken = [other.topic for other in seen.streams.values() if other.count]
        return Finding(stream.role.title, '', *silence_fault(stream, seen.topics, taken, seen.seconds, seen.is_bag))
    if key in (COLOR, DEPTH) and 0 < stream.rate_hz < LEAST_RATE_HZ:
        return Finding(stream.role.title, '', 'only %.1f Hz on %s' % (stream.rate_hz, stream.topic),
                       'USB 3, a wired network, a lower resolution or rate of the camera (realsense.launch fps:=15)')
    return Finding(stream.role.title, '%s, %.1f Hz' % (stream.topic, stream.rate_hz))


def _camera(seen):
    if seen.color_camera is None:
        return []
    camera, frame_id, fault = seen.color_camera
    return [_judged('camera', '%d x %d pixels, focal length %.0f, frame %s' % (camera[:3] + (frame_id,))
                    if camera else '', fault and '%s: %s' % (seen.streams[INFO].topic, fault),
                    'a RealSense fills it in by itself; calibrate other cameras (camera_calibration), and give the '
                    'driver the file')]


def _alignment(seen):
    """Check that depth has the image size, intrinsics and frame of colour."""
    if seen.depth is None or seen.color_camera is None or seen.color_camera.camera is None:
        return []
    camera, frame_id, _fault = seen.color_camera
    fault = size_fault(camera, seen.depth.width, seen.depth.height)
    if not fault and seen.depth_camera is not None and seen.depth_camera.camera is not None:
        fault = intrinsics_fault(camera, seen.depth_camera.camera)
    return [_judged('alignment', 'depth has the pixels and the frame of colour',
                    fault or frames_fault(frame_id, seen.depth.frame_id), ALIGN)]


def _encodings(seen):
    found = []
    for subject, image, fix in (
            ('colour', seen.color, 'set the camera to rgb8 or bgr8'),
            ('depth', seen.depth, 'mend the driver; where it cannot be, set depth_scale to metres per unit in '
             'config/bbox3d.yaml and config/tracker.yaml: 1.0 for metres, 0.001 for millimetres')):
        if image is not None:
            fact = '%s, %d x %d pixels' % (image.encoding, image.width, image.height)
            found.append(_judged(subject + ' encoding', fact, image.fault, fix))
    return found


def _stamps(seen):
    """Check for missing stamps and stamps far from the current time; only the first fault is reported."""
    for key in IMAGES:
        stream = seen.streams[key]
        if not has_come(seen, key):
            continue
        if not stream.stamps_ns:
            return [Finding('stamps', '', 'the messages on %s carry no stamp (zero)' % stream.topic,
                            'its publisher has to copy the time at which the image was taken')]
        fault, fix = _stamp_fault(seen, stream)
        if fault:
            return [Finding('stamps', '', fault, fix)]
    if not has_come(seen, DEPTH) or seen.streams[DEPTH].lag_s is None:
        return []
    return [Finding('stamps', 'depth images come %s after them' % span(max(0.0, seen.streams[DEPTH].lag_s)))]


def _stamp_fault(seen, stream):
    if seen.is_bag:
        if abs(stream.lag_s) <= LATE_S:
            return '', ''
        return ('the stamps on %s are %s from the time of their recording' % (stream.topic, span(abs(stream.lag_s))),
                'where a bag is recorded of one that is played, set use_sim_time and play with --clock; process_bag '
                'takes this one as it is')
    if seen.clock.use_sim_time and not seen.clock.count:
        return '', ''  # reported by _clock
    return clock_fault(stream, seen.clock.use_sim_time)


def _pairs_of_images(seen):
    share = None
    if has_come(seen, COLOR) and has_come(seen, DEPTH):
        share = paired_share(seen.streams[COLOR].stamps_ns, seen.streams[DEPTH].stamps_ns, seen.stamp_tolerance_s)
    if share is None:
        return []
    fact = '%.0f %% of the colour images have a depth image with their stamp' % (100 * share)
    return [_judged('pairs', fact,
                    'only %s, within %g s' % (fact, seen.stamp_tolerance_s) if share < LEAST_PAIRED else '',
                    'take depth that is aligned to colour (realsense.launch), one rate for both, or a larger '
                    'stamp_tolerance (config/bbox3d.yaml)')]


def _transforms(seen):
    if seen.tf is None:
        return []
    target, source, stamp_s, links, fault = seen.tf
    subject = 'transforms'
    if not fault:
        return [Finding(subject, '%s to %s is known at the stamp of the image' % (source, target))]
    why, fix = why_missing(links, target, source, stamp_s)
    said = 'no transform from %s to %s at the stamp of the image: %s' % (source, target, why or fault)
    return [Finding(subject, '', said, fix or 'look at rosrun tf view_frames')]


def _detector(seen):
    """Check that 2D boxes arrive if images do; detectors also publish empty arrays."""
    if has_come(seen, BOXES2D):
        return [Finding('detector', '%s, %.1f Hz' % (seen.streams[BOXES2D].topic, seen.streams[BOXES2D].rate_hz))]
    if not has_come(seen, COLOR) or seen.is_bag:
        return []
    fault, fix = silence_fault(seen.streams[BOXES2D], seen.topics, (), seen.seconds)
    return [Finding('detector', '', 'images come and no 2D boxes: %s' % fault, fix)]


def _pairs_of_boxes(seen):
    if not (has_come(seen, BOXES2D) and has_come(seen, DEPTH)):
        return []
    boxes, depth = seen.streams[BOXES2D], seen.streams[DEPTH]
    if not boxes.stamps_ns:
        return [Finding('boxes and depth', 'the 2D boxes carry no stamp: paired by when they come (assumed_delay)')]
    share = paired_share(boxes.stamps_ns, depth.stamps_ns, seen.stamp_tolerance_s)
    late_s = boxes.lag_s - depth.lag_s if boxes.lag_s is not None and depth.lag_s is not None else 0.0
    if late_s > seen.cache_length_s:
        return [Finding('boxes and depth', '', 'the 2D boxes come %.1f s after their depth image, which is kept for '
                        '%g s' % (late_s, seen.cache_length_s),
                        'a faster detector (smaller network, device:=cuda), or a larger cache_length '
                        '(config/bbox3d.yaml)')]
    if share is not None and share < LEAST_PAIRED:
        return [Finding('boxes and depth', '', 'only %.0f %% of the 2D boxes have a depth image with their stamp'
                        % (100 * share), 'the detector has to copy the stamp of its image into the label, or write no '
                        'label at all; compare rostopic echo %s' % boxes.topic)]
    return [] if share is None else [Finding('boxes and depth', '%.0f %% paired by stamp' % (100 * share))]


def _results(seen):
    """Check that 3D boxes and tracks arrive if their inputs do."""
    found = []
    can_lift = all(has_come(seen, key) for key in (DEPTH, INFO, BOXES2D))
    can_track = has_come(seen, BOXES3D) and seen.tf is not None and not seen.tf.fault
    for key, needs, subject in ((BOXES3D, can_lift, '3D boxes'), (TRACKS, can_track, 'tracks')):
        if has_come(seen, key):
            stream = seen.streams[key]
            found.append(Finding(subject, '%s, %.1f Hz' % (stream.topic, stream.rate_hz)))
        elif needs and not seen.is_bag:
            found.append(Finding(subject, '', *silence_fault(seen.streams[key], seen.topics, (), seen.seconds)))
    return found


def _nodes(seen, is_explained):
    """Report the status of each node; faults only if no other check has found a cause."""
    found = []
    for name, (level, sentence) in sorted(seen.nodes.items()):
        if level == 0:
            found.append(Finding(name, sentence))
        elif not is_explained:
            found.append(Finding(name, '', sentence, 'see its log, and "Troubleshooting" in the README'))
    return found
