"""Checks of a graph or a bag, in the order of the pipeline, so that the first fault found is the likely cause.

A check yields its findings, both faults and facts, and none if its input is missing: without depth images, for example,
their unit is not checked.
"""
from ros_3d_bb.camera.alignment import ALIGN, frames_fault, intrinsics_fault, size_fault, target_frame_fault
from ros_3d_bb.conversions.camera_msgs import COLOR_TOPIC, DEPTH_TOPIC, DEPTH_TOPICS, INFO_TOPICS
from ros_3d_bb.conversions.image_msgs import DEPTH_SCALES
from ros_3d_bb.conversions.perception_msgs import BOXES3D_TOPIC, BOXES_TOPIC, LATEST_NS, TRACKS_TOPIC
from ros_3d_bb.diagnosis.observations import IMAGE, KEPT, Finding, Role
from ros_3d_bb.diagnosis.tf_tree import optical_frame_fix, pose_fix, root_of, why_missing
from ros_3d_bb.diagnosis.topic_faults import (LATE_S, MIN_PAIRED, MIN_RATE_HZ, NO_CLOCK, clock_fault, paired_share,
                                              publishers_fault, silence_fault, span)

COLOR, DEPTH, INFO, BOXES2D, BOXES3D, TRACKS = 'color', 'depth', 'info', 'boxes2d', 'boxes3d', 'tracks'
IMAGES = COLOR, DEPTH, INFO
MAX_REPEATED = 0.2  # share of the messages on a topic with the stamp of the one before; chosen
UNSTAMPED_FIX = 'their publisher must set it to the time at which the image was taken'
UNIT_FIX = ('correct the driver, or set depth_scale to metres per unit in config/bbox3d.yaml, config/tracker.yaml and, '
            'for detector:=depth, config/depth_detector.yaml: 1.0 for metres, 0.001 for millimetres')
NO_DEPTH_FIX = ('pass the topic of depth images in 16UC1 or 32FC1 (camera_depth:=TOPIC); compressed ones end in '
                '/compressedDepth: JPEG changes depth')
CAMERA = 'the camera (roslaunch ros_3d_bb realsense.launch)'
CAMERA_SILENT = 'is the camera plugged in, the bag still playing (not paused), the network fast enough for images?'
DETECTOR_SILENT = ('is the detector paused (call its service ~enable with true), still loading its weights, or '
                   'configured to publish no empty arrays (publish_empty: false)?')
ROLES = {
    COLOR: Role('colour images', COLOR_TOPIC, IMAGE, 'camera_image', CAMERA, CAMERA_SILENT),
    DEPTH: Role('depth images', DEPTH_TOPIC, IMAGE, 'camera_depth', CAMERA, CAMERA_SILENT),
    INFO: Role('camera_info', INFO_TOPICS[0], 'sensor_msgs/CameraInfo', 'camera_info', CAMERA, CAMERA_SILENT),
    BOXES2D: Role('2D boxes', BOXES_TOPIC, 'std_msgs/Int32MultiArray', 'bb_topic',
                  'a detector (pipeline.launch detector:=yolov5 or depth)', DETECTOR_SILENT),
    BOXES3D: Role('3D boxes', BOXES3D_TOPIC, 'ros_3d_bb/BoundingBox3DArray', '', 'bbox3d_node (pipeline.launch)',
                  'see its log'),
    TRACKS: Role('tracks', TRACKS_TOPIC, 'ros_3d_bb/TrackedObjectArray', '', 'tracker_node (pipeline.launch)',
                 'see its log')}


def role_named(name, kind):
    """Return the Role of a topic by its name in the nodes; a generic Role for topics outside the pipeline."""
    other = Role(kind, name, kind, '', 'its publisher', 'check its publisher')
    return next((role for role in ROLES.values() if role.name == name), other)


def findings(seen):
    """Run all checks of an `Observations`. Returns a list of Finding."""
    checks = (_clock, _publishers, _images, _camera, _alignment, _encodings, _stamps, _pairs_of_images, _transforms,
              _mount, _pairs_of_boxes, _results)
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
    needs_no_color = seen.is_bag and seen.streams[BOXES2D].count and not seen.streams[COLOR].count
    for key in (DEPTH, INFO) if needs_no_color else IMAGES:
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
                          'use USB 3, a wired network, or a lower resolution or rate (realsense.launch fps:=15)')
        else:
            yield Finding(title, fact)


def _camera(seen):
    if seen.color_info is None:
        return
    info, camera, fault = seen.color_info
    if fault:
        yield Finding('camera', '', '%s: %s' % (seen.streams[INFO].topic, fault),
                      'calibrate the camera (camera_calibration), and pass the file to the driver; a RealSense has its '
                      'own calibration')
    else:
        yield Finding('camera', '%d x %d pixels, focal length %.0f, frame %s' % (camera[:3] + (info.header.frame_id,)))


def _alignment(seen):
    """Check that depth has the image size, intrinsics and frame of colour."""
    if seen.depth is None or seen.color_info is None or seen.color_info.fault:
        return
    if seen.depth_is_raw:
        yield Finding('alignment', 'raw depth, which the nodes register to colour', *_registration_fault(seen))
        return
    depth, camera = seen.depth.message, seen.color_info.converted
    fault = size_fault(camera, depth.width, depth.height) if depth.width else ''  # _encodings reports an empty image
    if not fault and seen.depth_info is not None and not seen.depth_info.fault:
        fault = intrinsics_fault(camera, seen.depth_info.converted)
    of_frames = '' if seen.frame_id else frames_fault(seen.color_info.message.header.frame_id, depth.header.frame_id)
    yield Finding('alignment', 'depth has the pixels and the frame of colour', fault or of_frames or seen.edges_fault,
                  ALIGN)


def _registration_fault(seen):
    """Return why raw depth in a bag cannot be registered, and the fix; empty if it can."""
    if not seen.is_bag:
        return ()
    if seen.depth_info is None:
        return ('there is no camera_info of the depth camera', 'record it, or remap %s to it' % DEPTH_TOPICS['raw'][1])
    color, depth = (one.message.header.frame_id.lstrip('/') for one in (seen.color_info, seen.depth))
    links = seen.tf.links if seen.tf is not None else {}
    if root_of(links, color) != root_of(links, depth):
        return ('tf has no transform from %s to %s, with which raw depth is registered' % (depth, color),
                'record /tf_static of the camera driver (publish_tf:=true)')
    return ()


def _encodings(seen):
    is_depth = seen.depth is not None and seen.depth.message.encoding in DEPTH_SCALES
    for subject, image, fix in (
            ('colour', seen.color, 'set the camera to rgb8 or bgr8'),
            ('depth', seen.depth, UNIT_FIX if is_depth else NO_DEPTH_FIX)):
        if image is not None:
            fact = '%s, %d x %d pixels' % (image.message.encoding, image.message.width, image.message.height)
            yield Finding(subject + ' encoding', fact, image.fault, fix)


def _stamps(seen):
    """Check for missing stamps and stamps far from the current time; only the first fault is reported."""
    for key in IMAGES:
        fault, fix = _stamp_fault(seen, key)
        if fault:
            yield Finding('stamps', '', fault, fix)
            return
    if seen.streams[DEPTH].count and seen.streams[DEPTH].lag_s is not None:
        yield Finding('stamps', 'depth images arrive %s after their stamp' % span(max(0.0, seen.streams[DEPTH].lag_s)))


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
    """Whether colour and depth images that arrive together have stamps that are too far apart to be paired."""
    lags_s = [seen.streams[key].lag_s for key in (COLOR, DEPTH)]
    return None not in lags_s and abs(lags_s[0] - lags_s[1]) > seen.cache_length_s


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
    target, source, stamp_s, links, fault, of_viewing = seen.tf
    if not source:
        yield Finding('transforms', '', 'the images have no frame_id',
                      'set it in their publisher, or pass frame_id:=FRAME (process_bag: frame_id in the file of '
                      '--bbox3d-params)')
        return
    optical_fault = target_frame_fault(target, source)
    if optical_fault:
        yield Finding('transforms', '', optical_fault, 'frame_world:=map, and %s' % pose_fix(source))
    elif fault:
        cause, fix = why_missing(links, target, source, stamp_s)
        fault = 'no transform from %s to %s at the stamp of the image: %s' % (source, target, cause or fault)
        yield Finding('transforms', '', fault, fix or 'inspect the tree with rosrun tf view_frames')
    elif of_viewing:
        yield Finding('transforms', '', of_viewing, optical_frame_fix(links, source))
    else:
        yield Finding('transforms', '%s to %s is available at the stamp of the image' % (source, target))


def _mount(seen):
    """Report how a camera without the pose in tf is mounted, and whether its images must be rotated."""
    mount = seen.mount
    if mount is None:
        return
    if mount.turns:
        yield Finding('image rotation', '', '%d people are found in %d images, and %d if they are turned clockwise by '
                      '%d degrees' % (mount.people[0], mount.images, mount.people[mount.turns], 90 * mount.turns),
                      'pass image_rotation:=%d (process_bag: --image-rotation %d)' % (2 * (90 * mount.turns,)))
    if mount.pose is not None:
        yield Finding('floor', 'the camera is %.2f m above it, tilted by %.2f rad and rolled by %.2f rad; fitted to '
                      'the depth images' % mount.pose)


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
                      'use a faster detector (smaller network, device:=cuda), or a larger cache_length '
                      '(config/bbox3d.yaml)')
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
            yield Finding(stream.role.title, '%s, %.1f Hz' % (stream.topic, stream.rate_hz))
        elif has_inputs[key] and not seen.is_bag:
            yield Finding(stream.role.title, '', *silence_fault(stream, seen.topics, (), seen.seconds))


def _nodes(seen, is_explained):
    """Report the status of each node; faults only if no other check has found a cause."""
    for name, (level, sentence) in sorted(seen.nodes.items()):
        if level == 0:
            yield Finding(name, sentence)
        elif not is_explained:
            yield Finding(name, '', sentence, 'see its log, and doc/troubleshooting.md')
