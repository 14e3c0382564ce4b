"""Explain why a tf lookup fails: unknown frames, disconnected trees, outdated transforms."""
from typing import NamedTuple

import numpy as np
from yaml import YAMLError

from ros_3d_bb.camera.alignment import is_optical
from ros_3d_bb.core.params import nearest_name
from ros_3d_bb.core.yaml_loader import load_yaml
from ros_3d_bb.diagnosis.topic_faults import EARLY_S
from ros_3d_bb.pipeline.transform_buffer import path_to_root

NAMED = 8  # frames listed in a sentence
ROBOT_FRAMES = 'odom', 'base_link'  # roots of the tree of a robot without localisation (REP 105)
MIN_IN_TIME = 0.5  # required share of the images with a transform in time
SAME_TILT_RAD, SAME_HEIGHT = 0.05, 0.15  # of a camera by tf and by its images; the latter as a share; chosen


class Link(NamedTuple):
    """The parent of a frame, and the oldest and newest stamp of their transform, seconds; (0, 0) if it is static."""

    parent: str
    oldest_s: float
    newest_s: float


def links_in(text):
    """Parse the output of all_frames_as_yaml (tf2) to {frame: Link}. Empty if a frame name makes it invalid YAML."""
    try:
        entries = load_yaml(text) or {}
    except YAMLError:
        return {}
    return {str(frame): Link(str(entry['parent']), float(entry['oldest_transform']),
                             float(entry['most_recent_transform']))
            for frame, entry in entries.items()}


def frames_in(links):
    return set(links).union(link.parent for link in links.values())


def root_of(links, frame):
    return path_to_root({child: link.parent for child, link in links.items()}, frame)[-1]


def optical_frames(links):
    """The optical frames of colour in {frame: Link}, or all, if none is named so."""
    frames = sorted(filter(is_optical, frames_in(links)))
    return [frame for frame in frames if 'color' in frame or 'rgb' in frame] or frames


def is_fixed_root(tf, mount):
    """Whether tracks can be in the root of the tree of a camera, which is not the target frame: the root is that of a
    robot, and not a frame that moves with the camera. Takes the TfSeen and the CameraMount, None if it is unknown.

    It is by its name, if the camera moves in it, or if its z = 0 plane is the floor that the camera sees.
    """
    if root_of(tf.links, tf.source) in ROBOT_FRAMES or tf.moves:
        return True
    if mount is None or not is_height_of(tf, mount.pose):
        return False
    normal = tf.root_from_camera[2, :3]  # z axis of the root in the optical frame
    return abs(np.arctan2(-normal[2], np.hypot(normal[0], normal[1])) - mount.pose.tilt_rad) < SAME_TILT_RAD


def is_height_of(tf, pose):
    """Whether a CameraPose, None if it is unknown, has the height of the camera in the root of tf, by a TfSeen."""
    return (tf.root_from_camera is not None and pose is not None
            and abs(tf.root_from_camera[2, 3] - pose.height_m) < SAME_HEIGHT * pose.height_m)


def why_missing(links, target, source, stamp_s, mount=None, is_fixed=None):
    """Explain why there is no transform from the camera's frame `source` to the fixed frame `target` of the tracks.

    `links` is {frame: Link}, and `stamp_s` the stamp of the image in seconds, or 0 for the latest transform. `mount` is
    the CameraMount and `is_fixed` the result of `is_fixed_root`, None if they are unknown. Returns the fault and its
    fix; both are empty if the links show no fault.
    """
    frames = sorted(frames_in(links))
    if not frames:
        return ('tf has no frames: no transforms on /tf or /tf_static',
                'start robot_state_publisher and the localisation of the robot; for a camera alone, %s'
                % pose_fix(source, mount))
    if source not in frames:
        more = ' and %d more' % (len(frames) - NAMED) if len(frames) > NAMED else ''
        fix = 'publish the pose of the camera: ' + _publisher_command('base_link', source)
        optical = optical_frames(links)
        if optical:
            fix += '; or, if it has another name in tf: frame_id:=' + nearest_name(source, optical)
        return 'tf has no frame %s; its frames: %s%s' % (source, ', '.join(frames[:NAMED]), more), fix
    parents = {frame: link.parent for frame, link in links.items()}
    up, down = path_to_root(parents, source), path_to_root(parents, target)
    if target not in frames and is_optical(up[-1]):
        return 'tf has no frame %s; the tree of the camera is %s' % (target, ' < '.join(up)), pose_fix(up[-1], mount)
    if target not in frames:
        fixes = []
        if is_fixed is not False:
            fixes.append('start the localisation of the robot in %s, or track in another frame: frame_world:=%s '
                         '(process_bag: --target-frame %s)' % (target, up[-1], up[-1]))
        if not is_fixed and up[-1] not in ROBOT_FRAMES:
            fixes.append('for a camera that is not on a robot, camera_root:=%s, and %s'
                         % (up[-1], pose_fix(source, mount)))
        fix = '; '.join(fixes)
        return 'tf has no frame %s; the tree of the camera is %s' % (target, ' < '.join(up)), fix
    if up[-1] != down[-1]:
        return ('tf has two trees, %s and %s, without a transform between them' % (' < '.join(up), ' < '.join(down)),
                _missing_link(frames, up[-1], target))
    return _outdated_link(links, up, down, stamp_s)


def _missing_link(frames, root, target):
    parent = 'base_link' if root != 'base_link' and 'base_link' in frames else target
    if root in ROBOT_FRAMES:
        return 'start the localisation of the robot (publishes %s to %s), or frame_world:=%s' % (target, root, root)
    return _publisher_command(parent, root)


def pose_fix(frame, mount=None):
    """How to give the pose of a camera that is not on a robot, whose optical frame is `frame`: with the numbers of its
    CameraMount, None if its images were not examined."""
    if mount is not None and mount.pose is not None:
        return ('pass camera_height:=%.2f camera_tilt:=%.2f camera_roll:=%.2f frame_id:=%s (process_bag: '
                '--camera-height %.2f --camera-tilt %.2f --camera-roll %.2f), which fit the floor in the depth images'
                % (mount.pose + (frame,) + mount.pose))
    fix = ('measure its height above the floor, metres, and its tilt, radians, positive if it looks down, and pass '
           'camera_height:=, camera_tilt:= and frame_id:=%s (process_bag: --camera-height, --camera-tilt)' % frame)
    return fix if mount is not None else (
        fix + '; or let camera_pose:=floor (--camera-pose floor) fit both to the floor in the depth images')


def optical_frame_fix(links, frame):
    """How to correct the frame of images, or its transform, which have the axes of a body."""
    if is_optical(frame):
        return 'correct its transform: ' + _publisher_command(links[frame].parent, frame)
    optical = optical_frames(links)
    name = nearest_name(frame, optical) if optical else frame + '_optical_frame'
    fix = 'frame_id:=%s (process_bag: frame_id in the file of --bbox3d-params)' % name
    return fix if optical else ('publish it by rosrun tf2_ros static_transform_publisher 0 0 0 -1.5708 0 -1.5708 %s '
                                '%s, and pass %s' % (frame, name, fix))


def _publisher_command(parent, frame):
    """The command that publishes the pose of a frame; that of an optical frame is given for a level camera."""
    angles = '-1.5708 0 -1.5708' if is_optical(frame) else 'YAW PITCH ROLL'
    return 'rosrun tf2_ros static_transform_publisher X Y Z %s %s %s' % (angles, parent, frame)


def _outdated_link(links, up, down, stamp_s):
    """Find the link between two frames of one tree that has no transform at the stamp; 0 means the latest."""
    between = [(links[frame], frame) for frame in set(up) ^ set(down)]
    moving = [(link, frame) for link, frame in between if link.newest_s != 0]
    behind = [(link.newest_s, link, frame) for link, frame in moving if link.newest_s < stamp_s]
    ahead = [(link.oldest_s, link, frame) for link, frame in moving if link.oldest_s > stamp_s]
    if stamp_s and behind:
        newest_s, link, frame = min(behind)
        return ('the transform from %s to %s ends %.3f s before the stamp of the image'
                % (frame, link.parent, stamp_s - newest_s),
                'is the publisher of %s still running, in time, and on a machine with the same clock?' % frame)
    if stamp_s and ahead:
        oldest_s, link, frame = max(ahead)
        return ('the transform from %s to %s begins %.3f s after the stamp of the image'
                % (frame, link.parent, oldest_s - stamp_s),
                'no action for images from before the start; otherwise compare the clocks of the machines (chrony)')
    return '', ''


def clock_fault_of_tf(tf, images_lag_s, timeout_s):
    """Return why the transforms in a TfSeen are of another time than the images, and the fix; empty if they are not.

    `images_lag_s` is the arrival of the images minus their stamp, None if it is unknown, and `timeout_s` is how long
    they wait for their transforms.
    """
    if not tf.lags_s:
        return '', ''
    late, ahead = max(tf.lags_s, key=tf.lags_s.get), min(tf.lags_s, key=tf.lags_s.get)
    fix = 'synchronise the clocks of all machines and of the camera (chrony, settings of the driver)'
    if tf.lags_s[ahead] < -EARLY_S:
        return ('the stamps of the transforms from %s to %s are %.1f s after the time of their arrival: at the stamp '
                'of an image, tf has an earlier pose' % (ahead, tf.links[ahead].parent, -tf.lags_s[ahead]), fix)
    behind_s = tf.lags_s[late] - (images_lag_s or 0.0)
    if tf.in_time is None or tf.in_time >= MIN_IN_TIME or behind_s <= timeout_s:
        return '', ''
    return ('the stamps of the transforms from %s to %s are %.1f s before those of images that arrive at the same '
            'time; images wait %g s for a transform (tf_timeout)' % (late, tf.links[late].parent, behind_s, timeout_s),
            fix + ', or reduce the delay of the publisher of %s' % late)
