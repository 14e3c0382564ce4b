"""Checks of a graph or a bag, in the order of the pipeline, so that the first fault found is the likely cause.

A check yields its findings, both faults and facts, and none if its input is missing: without depth images, for example,
their unit is not checked.
"""
from ros_3d_bb.camera.alignment import target_frame_fault
from ros_3d_bb.conversions.perception_msgs import LATEST_NS
from ros_3d_bb.diagnosis.camera_checks import FILES_OF_SCALE, check_alignment, check_camera, check_encodings
from ros_3d_bb.diagnosis.observations import KEPT, Finding
from ros_3d_bb.diagnosis.roles import BOXES2D, BOXES3D, COLOR, DEPTH, IMAGES, INFO, TRACKS, needed_images
from ros_3d_bb.diagnosis.tf_tree import (clock_fault_of_tf, frames_in, is_fixed_root, is_height_of, optical_frame_fix,
                                         pose_fix, root_of, why_missing)
from ros_3d_bb.diagnosis.topic_faults import (LATE_S, MIN_PAIRED, MIN_RATE_HZ, NO_CLOCK, clock_fault, paired_share,
                                              publishers_fault, silence_fault, span)

APART_S = 0.1  # between the stamps of images that arrive together: of different clocks, if one is in the future; chosen
MAX_REPEATED = 0.2  # share of the messages on a topic with the stamp of the one before; chosen
UNSTAMPED_FIX = 'their publisher must set it to the time at which the image was taken'


def findings(seen):
    checks = (_clock, _publishers, _images, check_camera, check_alignment, check_encodings, _stamps, _pairs_of_images,
              _transforms, _tilt, _mount, _pairs_of_boxes, _results)
    found = [finding for check in checks for finding in check(seen)]
    return found + list(_nodes(seen, any(finding.fault for finding in found)))


def _clock(seen):
    if seen.is_bag:
        return
    if seen.use_sim_time and not seen.clock_count:
        yield Finding('time', '', *NO_CLOCK)
    elif seen.clock_count and not seen.use_sim_time:
        yield Finding('time', '', '/clock is published, but /use_sim_time is not set: nodes ignore it',
                      'rosparam set use_sim_time true before the nodes start')
    else:
        yield Finding('time', 'from /clock' if seen.use_sim_time else "the machine's clock")


def _publishers(seen):
    """Report topics and frames that several nodes publish at once, as a driver beside a bag: each looks like a jump."""
    published = {}
    for stream in seen.streams.values():
        published.setdefault(stream.senders, []).append(stream.topic)
    for frame, nodes in sorted(seen.tf_senders.items()):
        published.setdefault(nodes, []).append('the frame %s of tf' % frame)
    for nodes, names in published.items():
        if nodes:
            yield Finding('publishers', '', *publishers_fault(names, nodes))


def _images(seen):
    for key in needed_images(seen):
        stream = seen.streams[key]
        title, fact = stream.role.title, '%s, %.1f Hz' % (stream.topic, stream.rate_hz)
        if not stream.count:
            used = [other.topic for other in seen.streams.values() if other.count]
            used += () if seen.depth_is_raw else seen.raw_topics
            fault, fix = silence_fault(stream, seen.topics, used, seen.seconds, seen.is_bag)
            if key == DEPTH and seen.raw_topics and not seen.depth_is_raw:
                fix += '; raw depth, on %s, is registered with depth:=raw (process_bag and doctor: --depth raw)' % (
                    ', '.join(seen.raw_topics))
            yield Finding(title, '', fault, fix)
        elif key != INFO and 0 < stream.rate_hz < MIN_RATE_HZ:
            yield Finding(title, fact, 'only %.1f Hz on %s' % (stream.rate_hz, stream.topic),
                          'use USB 3, a wired network, or a lower resolution or rate (realsense.launch fps:=15)', False)
        else:
            yield Finding(title, fact)


def _stamps(seen):
    """Check for missing stamps and stamps far from the current time; only the first fault is reported."""
    for key in IMAGES:
        fault, fix = _stamp_fault(seen, key)
        if fault:
            yield Finding('stamps', '', fault, fix)
            return
    if seen.streams[DEPTH].count and seen.streams[DEPTH].lag_s is not None:
        lag_s = seen.streams[DEPTH].lag_s
        yield Finding('stamps', 'depth images arrive %s %s their stamp' % (span(abs(lag_s)),
                                                                           'before' if lag_s < 0 else 'after'))


def _stamp_fault(seen, key):
    stream = seen.streams[key]
    stamps_ns, topic = stream.stamps_ns, stream.topic
    if not stream.count or (key == INFO and max(stamps_ns, default=0) < LATEST_NS):  # one is valid for all images
        return '', ''
    if not stamps_ns:
        return 'the messages on %s have no stamp (zero)' % topic, UNSTAMPED_FIX
    repeated = sum(one == other for one, other in zip(stamps_ns, stamps_ns[1:]))
    if repeated > MAX_REPEATED * len(stamps_ns):
        return ('%d of %d messages on %s have the stamp of the one before' % (repeated, len(stamps_ns), topic),
                UNSTAMPED_FIX)
    missing = min(stream.count, KEPT) - len(stamps_ns)
    if missing:
        return ('%d of %d messages on %s have no stamp (zero) and are rejected'
                % (missing, missing + len(stamps_ns), topic), UNSTAMPED_FIX)
    if max(stamps_ns) >= LATEST_NS:
        return ('the messages on %s have stamps of the year 2038 or later, which are rejected' % topic,
                'correct the clock of their publisher')
    if seen.use_sim_time and not seen.clock_count:
        return '', ''  # reported by _clock
    if not seen.is_bag:
        return clock_fault(stream, seen.use_sim_time)
    if abs(stream.lag_s) <= LATE_S or _clocks_differ(seen):  # reported by _pairs_of_images
        return '', ''
    is_usable = seen.tf is None or not seen.tf.fault
    return ('the stamps on %s are %s from the time of their recording' % (topic, span(abs(stream.lag_s))),
            'to record a bag while another one is played, set use_sim_time and play with --clock%s'
            % ('; process_bag accepts this bag as it is' if is_usable else ''))


def _clocks_differ(seen):
    """Whether colour and depth images that arrive together have stamps of different clocks: too far apart to be paired,
    later than their arrival, or apart although the images show the same time.
    """
    lags_s = [seen.streams[key].lag_s for key in (COLOR, DEPTH)]
    if None in lags_s:
        return False
    apart_s = abs(lags_s[0] - lags_s[1])
    return (apart_s > seen.cache_length_s or apart_s > APART_S and min(lags_s) < -APART_S
            or seen.edges_together == '' and seen.edges_fault != '')


def _pairs_of_images(seen):
    if _clocks_differ(seen):
        color, depth = seen.streams[COLOR], seen.streams[DEPTH]
        yield Finding('pairs', '', 'stamps on %s and %s that arrive together are %s apart'
                      % (color.topic, depth.topic, span(abs(color.lag_s - depth.lag_s))),
                      'their publishers must use the same clock, and send both in time')
        return
    share = paired_share(seen.streams[COLOR].stamps_ns, seen.streams[DEPTH].stamps_ns, seen.stamp_tolerance_s)
    if share is not None:
        fact = '%.0f %% of the colour images have a depth image with their stamp' % (100 * share)
        fault = 'only %s, within stamp_tolerance' % fact if share < MIN_PAIRED else ''
        yield Finding('pairs', fact, fault,
                      'use depth that is aligned to colour (realsense.launch), one rate for both, or a larger '
                      'stamp_tolerance (config/bbox3d.yaml)')


def _transforms(seen):
    if seen.tf is None:
        return
    target, source, stamp_s, links, fault, of_viewing = seen.tf[:6]
    if not source:
        yield Finding('transforms', '', 'the images have no frame_id',
                      'set it in their publisher, or pass frame_id:=FRAME (process_bag: frame_id in the file of '
                      '--bbox3d-params)')
        return
    optical_fault = target_frame_fault(target, source)
    clock_fault, clock_fix = clock_fault_of_tf(seen.tf, seen.streams[DEPTH].lag_s, seen.tf_timeout_s)
    if optical_fault:
        yield Finding('transforms', '', optical_fault, 'frame_world:=map, and %s' % pose_fix(source, seen.mount))
    elif clock_fault:
        yield Finding('transforms', '', clock_fault, clock_fix)
    elif fault:
        cause, fix = why_missing(links, target, source, stamp_s, seen.mount, is_fixed_root(seen.tf, seen.mount))
        fault = 'no transform from %s to %s at the stamp of the image: %s' % (source, target, cause or fault)
        yield Finding('transforms', '', fault, fix or 'inspect the tree with rosrun tf view_frames')
    elif of_viewing:
        yield Finding('transforms', '', of_viewing, optical_frame_fix(links, source))
    else:
        yield Finding('transforms', '%s to %s is available at the stamp of the image' % (source, target))


def _tilt(seen):
    """Report from which frame the tilt of the camera is, if tf does not contain ~floor_frame."""
    tf = seen.tf
    if tf is None or tf.root_from_camera is None or not seen.floor_frame or tf.fault or tf.viewing_fault:
        return
    if seen.floor_frame not in frames_in(tf.links):
        yield Finding('tilt', 'that of the camera in %s, as tf has no frame %s (floor_frame)'
                      % (root_of(tf.links, tf.source), seen.floor_frame))


def _mount(seen):
    """Report the unit of depth and, of a camera without the pose in tf, how it is mounted and if its images must be
    rotated."""
    mount, tf = seen.mount, seen.tf
    if mount is None:
        return
    factor = _factor(mount, tf)
    if factor is not None:
        yield Finding('depth unit', '', '%d people are found in %d images, and %d if depth is multiplied by %g'
                      % (mount.people[0], mount.images, mount.factors[factor][0], factor),
                      'set depth_scale: %g in %s' % (factor * seen.depth.converted.scale_m, FILES_OF_SCALE))
    if tf is None or not tf.fault:
        return
    if mount.turns:
        yield Finding('image rotation', '', '%d people are found in %d images, and %d if they are turned clockwise by '
                      '%d degrees' % (mount.people[0], mount.images, mount.people[mount.turns], 90 * mount.turns),
                      'pass image_rotation:=%d (process_bag: --image-rotation %d)' % (2 * (90 * mount.turns,)))
    if mount.pose is not None:
        yield Finding('floor', 'the camera is %.2f m above it, tilted by %.2f rad and rolled by %.2f rad; fitted to '
                      'the depth images' % mount.pose)


def _factor(mount, tf):
    """Return the factor of depth with which most people are found, and the camera is as high above the floor as by tf,
    if tf has its pose. None if there is none."""
    is_pose_known = tf is not None and not tf.fault
    people = {factor: count for factor, (count, pose) in mount.factors.items()
              if not is_pose_known or is_height_of(tf, pose)}
    return max(people, key=people.get) if people else None


def _pairs_of_boxes(seen):
    boxes, depth, subject = seen.streams[BOXES2D], seen.streams[DEPTH], 'boxes and depth'
    if not (boxes.count and depth.count):
        return
    if not boxes.stamps_ns:
        yield Finding(subject, 'the 2D boxes have no stamp: they are paired by their arrival (assumed_delay)')
        return
    share = paired_share(boxes.stamps_ns, depth.stamps_ns, seen.stamp_tolerance_s)
    late_s = boxes.lag_s - depth.lag_s if boxes.lag_s is not None and depth.lag_s is not None else 0.0
    if late_s > seen.cache_length_s:
        yield Finding(subject, '', 'the 2D boxes arrive %.1f s after their depth image, which is cached for %g s'
                      % (late_s, seen.cache_length_s),
                      'use a faster detector (smaller network, device:=cuda), or a larger cache_length in the '
                      'file of bbox3d_params:=')
    elif share is not None and share < MIN_PAIRED:
        yield Finding(subject, '', 'only %.0f %% of the 2D boxes have a depth image with their stamp' % (100 * share),
                      'the detector must copy the stamp of its image into the label, or write no label at all; compare '
                      'rostopic echo %s' % boxes.topic)
    elif share is not None:
        yield Finding(subject, '%.0f %% paired by stamp' % (100 * share))


def _results(seen):
    """Check that boxes and tracks arrive if their inputs do; detectors also publish empty arrays."""
    has_inputs = {BOXES2D: seen.streams[COLOR].count,
                  BOXES3D: all(seen.streams[key].count for key in (DEPTH, INFO, BOXES2D)),
                  TRACKS: seen.streams[BOXES3D].count and seen.tf is not None and not seen.tf.fault}
    for key in (BOXES2D, BOXES3D, TRACKS):
        stream = seen.streams[key]
        if stream.count:
            empty = ', all empty' if stream.is_empty else ''
            yield Finding(stream.role.title, '%s, %.1f Hz%s' % (stream.topic, stream.rate_hz, empty))
        elif has_inputs[key] and not seen.is_bag:
            yield Finding(stream.role.title, '', *silence_fault(stream, seen.topics, (), seen.seconds))


def _nodes(seen, is_explained):
    """Report the status of each node; faults only if no other check has found a cause."""
    for name, (level, sentence) in sorted(seen.nodes.items()):
        if level == 0:
            yield Finding(name, sentence)
        elif not is_explained:
            yield Finding(name, '', sentence, 'see its log, and doc/troubleshooting.md')
