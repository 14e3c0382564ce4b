"""The next command on the way from a bag to its tracks, and to a picture of them."""
from shlex import quote

from ros_3d_bb.camera.alignment import target_frame_fault
from ros_3d_bb.conversions.camera_msgs import DEPTH_TOPIC, DEPTH_TOPICS, RAW, info_topic_beside
from ros_3d_bb.core.params import nearest_name
from ros_3d_bb.diagnosis.checks import COLOR, DEPTH, IMAGES, TRACKS
from ros_3d_bb.diagnosis.tf_tree import ROBOT_FRAMES, root_of
from ros_3d_bb.diagnosis.topic_faults import other_topic

DEFAULT_TARGET = 'map'  # of process_bag and doctor
MIN_ROLL_RAD = 0.02  # smaller ones are within the error of the fitted floor


def next_command(bag, seen, found):
    """Return the next command for a bag, and what it does; ('', '') if a fault must be fixed first.

    `seen` are the Observations of the bag, and `found` the list of Finding on them.
    """
    names = {stream.role.name: stream.topic for stream in seen.streams.values()
             if stream.count and stream.topic.lstrip('/') != stream.role.name}
    if seen.depth_is_raw and seen.depth_info_topic.lstrip('/') != DEPTH_TOPICS[RAW][1]:
        names[DEPTH_TOPICS[RAW][1]] = seen.depth_info_topic
    option = ' --depth raw' if seen.depth_is_raw else ''
    target = '' if seen.tf is None or seen.tf.target == DEFAULT_TARGET else ' --target-frame ' + seen.tf.target
    missing = [seen.streams[key] for key in IMAGES if not seen.streams[key].count]
    used = [stream.topic for stream in seen.streams.values() if stream.count]
    used += () if seen.depth_is_raw else seen.raw_topics
    others = {stream.role.name: other_topic(stream, seen.topics, used) for stream in missing}
    color = dict(names, **others).get(seen.streams[COLOR].role.name)
    report = 'rosrun ros_3d_bb scene_report %s' + (' --color-topic ' + quote(color) if color else '')
    if seen.streams[TRACKS].count:
        return report % quote(bag), 'draws the tracks'
    faults = set(finding.subject for finding in found if finding.fault)
    raw = _raw_topic(seen, 'alignment' in faults)
    purpose = 'checks the topics that probably are the missing ones' if missing else ''
    if not option and raw and ('alignment' in faults or others.get(DEPTH_TOPIC) == ''):
        option, purpose = ' --depth raw', 'checks the raw depth, which process_bag registers to colour'
        for topics in (names, others):
            topics.pop(DEPTH_TOPIC, None)
        raw_topics = zip(DEPTH_TOPICS[RAW], (raw, info_topic_beside(raw)))
        others.update((name, topic) for name, topic in raw_topics if topic.lstrip('/') != name)
    if purpose and all(others.values()):
        options = option + target + _remappings(dict(names, **others))
        return 'rosrun ros_3d_bb doctor %s%s' % (quote(bag), options), purpose
    pose = None if missing or faults - {'transforms', 'image rotation'} else _frame_and_pose(seen, target, faults)
    if pose is None:
        return '', ''
    command = 'rosrun ros_3d_bb process_bag %s tracked.bag --detector depth%s%s%s && %s' % (
        quote(bag), option, _remappings(names, ' --remap '), pose[0], report % 'tracked.bag')
    return command, 'tracks people and draws them' + pose[1]


def _raw_topic(seen, is_misaligned):
    """Return the topic of raw depth in a bag; empty if there is none."""
    depth = seen.streams[DEPTH]
    if is_misaligned and depth.count and not seen.edges_fault:
        return depth.topic
    return nearest_name('/' + DEPTH_TOPICS[RAW][0], seen.raw_topics) if seen.raw_topics else ''


def _frame_and_pose(seen, target, faults):
    """Return the options for the frame of the tracks and the pose of the camera, and a hint; None if tf must be
    corrected first. `target` is the option for the frame that was checked."""
    if not faults:
        return target, ''
    root = root_of(seen.tf.links, seen.tf.source)
    if not root or root == seen.tf.target or target_frame_fault(seen.tf.target, seen.tf.source):
        return None
    if root in ROBOT_FRAMES:
        return ' --target-frame ' + root, ''
    options, hint = _pose(seen.mount)
    return target + options, hint


def _pose(mount):
    """Return the options for the pose of a camera without tf, from its CameraMount or None, and a hint."""
    if mount is None:  # of raw depth
        return ' --camera-pose floor', '; height, tilt and roll of the camera are fitted to the floor in its images'
    turned = ' --image-rotation %d' % (90 * mount.turns) if mount.turns else ''
    if mount.pose is None:
        return (' --camera-height HEIGHT --camera-tilt TILT' + turned,
                '; fill in the height of the camera above the floor, metres, and its tilt, radians, positive if it '
                'looks down')
    height_m, tilt_rad, roll_rad = mount.pose
    roll = ' --camera-roll %.2f' % roll_rad if abs(roll_rad) > MIN_ROLL_RAD else ''
    return (' --camera-height %.2f --camera-tilt %.2f%s%s' % (height_m, tilt_rad, roll, turned),
            '; height and tilt are those of the floor in the depth images: correct them if they are known')


def _remappings(names, separator=' '):
    return ''.join('%s%s:=%s' % (separator, name, topic) for name, topic in sorted(names.items()))
