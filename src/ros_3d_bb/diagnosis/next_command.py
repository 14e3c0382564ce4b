"""The next command on the way from a bag to its tracks, and to a picture of them.

Users execute it as it is: there is none if its result could be wrong.
"""
from shlex import quote
from typing import NamedTuple

from ros_3d_bb.camera.alignment import target_frame_fault
from ros_3d_bb.conversions.camera_msgs import DEPTH_TOPIC, DEPTH_TOPICS, RAW, info_topic_beside
from ros_3d_bb.core.params import nearest_name
from ros_3d_bb.diagnosis.roles import COLOR, DEPTH, TRACKS, needed_images
from ros_3d_bb.diagnosis.tf_tree import frames_in, is_fixed_root, optical_frames, root_of
from ros_3d_bb.diagnosis.topic_faults import other_topic
from ros_3d_bb.pipeline.detectors import NONE, without_weights

DEFAULT_TARGET = 'map'  # of process_bag and doctor
MIN_ROLL_RAD = 0.02  # smaller ones are within the error of the fitted floor
CORRECTED = {'transforms', 'image rotation'}  # subjects of faults that options of process_bag correct
FRAME_FILE = 'frame.yaml'
REPORT = 'rosrun ros_3d_bb scene_report %s%s'


class Reading(NamedTuple):
    """How the nodes read a bag: the names of their topics in it, and whether depth is registered to colour."""

    names: dict
    is_raw: bool

    @property
    def option(self):
        return ' --depth raw' if self.is_raw else ''

    def remappings(self, separator):
        return ''.join('%s%s:=%s' % (separator, name, quote(topic)) for name, topic in sorted(self.names.items())
                       if topic.lstrip('/') != name)


class Pose(NamedTuple):
    """Options of process_bag for the frame of the tracks and the pose of the camera, a hint for the user, and a command
    that must precede it.
    """

    options: str
    hint: str = ''
    preparation: str = ''


def next_command(bag, seen, found):
    """Return the next command for a bag, and what it does; ('', '') if a fault must be fixed first.

    `seen` are the Observations of the bag, and `found` the list of Finding on them.
    """
    fatal = set(finding.subject for finding in found if finding.fault and finding.is_fatal)
    reading = _reading(seen)
    if seen.streams[TRACKS].count:
        return REPORT % (quote(bag), _color_option(reading, seen)), 'draws the tracks'
    target = '' if seen.tf is None or seen.tf.target == DEFAULT_TARGET else ' --target-frame ' + seen.tf.target
    other, purpose = _other_reading(reading, seen, fatal)
    if purpose:
        command = 'rosrun ros_3d_bb doctor %s%s%s%s' % (quote(bag), other.option, target, other.remappings(' '))
        return ('', '') if None in other.names.values() else (command, purpose)
    pose = None if fatal - CORRECTED else _pose(seen, fatal, target)
    if pose is None:
        return '', ''
    detector = without_weights()[0] if COLOR in needed_images(seen) else NONE
    command = '%srosrun ros_3d_bb process_bag %s tracked.bag --detector %s%s%s%s && %s' % (
        pose.preparation, quote(bag), detector, reading.option, reading.remappings(' --remap '), pose.options,
        REPORT % ('tracked.bag', _color_option(reading, seen)))
    return command, 'tracks people and draws them' + pose.hint


def _color_option(reading, seen):
    topic = reading.names.get(seen.streams[COLOR].role.name)
    return ' --color-topic ' + quote(topic) if topic and topic != '/' + seen.streams[COLOR].role.name else ''


def _reading(seen):
    names = {stream.role.name: stream.topic for stream in seen.streams.values() if stream.count}
    if seen.depth_is_raw:
        names[DEPTH_TOPICS[RAW][1]] = seen.depth_info_topic
    return Reading(names, seen.depth_is_raw)


def _other_reading(reading, seen, fatal):
    """Return a Reading that may be the right one, and why, if topics are missing or depth is not aligned. Its names are
    None for topics that the bag lacks."""
    missing = [seen.streams[key] for key in needed_images(seen) if not seen.streams[key].count]
    used = [stream.topic for stream in seen.streams.values() if stream.count]
    used += () if reading.is_raw else seen.raw_topics
    others = {stream.role.name: other_topic(stream, seen.topics, used) or None for stream in missing}
    names = dict(reading.names, **others)
    raw = '' if reading.is_raw else _raw_topic(seen, fatal)
    if raw and ('alignment' in fatal or others.get(DEPTH_TOPIC, '') is None):
        names.pop(DEPTH_TOPIC)
        names.update(zip(DEPTH_TOPICS[RAW], (raw, info_topic_beside(raw))))
        return Reading(names, True), 'checks the raw depth, which process_bag registers to colour'
    return Reading(names, reading.is_raw), missing and 'checks the topics that probably are the missing ones'


def _raw_topic(seen, fatal):
    """Return the topic of raw depth in a bag; empty if there is none. Its images are in a frame of their own."""
    depth = seen.streams[DEPTH]
    if 'alignment' in fatal and depth.topic in seen.raw_topics:
        return depth.topic
    return nearest_name('/' + DEPTH_TOPICS[RAW][0], seen.raw_topics) if seen.raw_topics else ''


def _pose(seen, fatal, target):
    """Return the Pose; None if tf must be corrected first. `target` is the option for the frame that was checked."""
    tf = seen.tf
    if not CORRECTED & fatal:
        color_frame = seen.color_info.message.header.frame_id.lstrip('/')
        is_other = not seen.depth_is_raw and tf.source != color_frame and color_frame in frames_in(tf.links)
        return _pose_in_frame(color_frame, target, 'that of the colour images') if is_other else Pose(target)
    if not tf.source or target_frame_fault(tf.target, tf.source):
        return None
    root = root_of(tf.links, tf.source)
    if tf.links and (tf.viewing_fault or tf.source not in frames_in(tf.links)):
        return _pose_of_other_frame(tf, target)
    if root == tf.target:
        return None
    if is_fixed_root(tf, seen.mount):
        return Pose(' --target-frame ' + root)
    return _pose_of_camera(seen.mount, target)


def _pose_of_other_frame(tf, target):
    """Return the Pose if tf has a single optical frame, which must be that of the images; None otherwise."""
    frames = optical_frames(tf.links)
    if len(frames) != 1 or tf.source in frames or root_of(tf.links, frames[0]) != tf.target:
        return None
    return _pose_in_frame(frames[0], target, 'the only optical frame in tf')


def _pose_in_frame(frame_id, target, reason):
    options = '%s --bbox3d-params %s --detector-params %s' % (target, FRAME_FILE, FRAME_FILE)
    preparation = 'echo %s > %s && ' % (quote('frame_id: ' + frame_id), FRAME_FILE)
    return Pose(options, '; %s is %s' % (frame_id, reason), preparation)


def _pose_of_camera(mount, target):
    """Return the Pose of a camera without tf, from its CameraMount or None; None if no floor is visible."""
    if mount is None:  # of raw depth
        return Pose(target + ' --camera-pose floor',
                    '; height, tilt and roll of the camera are fitted to the floor in its images')
    if mount.pose is None:
        return None
    height_m, tilt_rad, roll_rad = mount.pose
    roll = ' --camera-roll %.2f' % roll_rad if abs(roll_rad) > MIN_ROLL_RAD else ''
    turned = ' --image-rotation %d' % (90 * mount.turns) if mount.turns else ''
    return Pose('%s --camera-height %.2f --camera-tilt %.2f%s%s' % (target, height_m, tilt_rad, roll, turned),
                '; height and tilt are those of the floor in the depth images: correct them if they are known')
