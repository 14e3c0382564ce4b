"""Explain why a tf lookup fails: unknown frames, disconnected trees, outdated transforms."""
from typing import NamedTuple

from yaml import YAMLError

from ros_3d_bb.camera.alignment import is_optical
from ros_3d_bb.core.params import nearest_name
from ros_3d_bb.core.yaml_loader import load_yaml
from ros_3d_bb.pipeline.transform_buffer import path_to_root

NAMED = 8  # frames listed in a sentence
ROBOT_FRAMES = 'odom', 'base_link'  # roots of the tree of a robot without localisation (REP 105)


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


def root_of(links, frame):
    """The root of the tree of a frame; `links` is {frame: Link}."""
    return path_to_root({child: link.parent for child, link in links.items()}, frame)[-1]


def why_missing(links, target, source, stamp_s):
    """Explain why there is no transform from the camera's frame `source` to the fixed frame `target` of the tracks.

    `links` is {frame: Link}, and `stamp_s` the stamp of the image in seconds, or 0 for the latest transform. Returns
    the fault and its fix; both are empty if the links show no fault.
    """
    frames = sorted(set(links) | set(link.parent for link in links.values()))
    if not frames:
        return ('tf has no frames: no transforms on /tf or /tf_static',
                'start robot_state_publisher and the localisation of the robot; for a camera alone, %s'
                % pose_fix(source))
    if source not in frames:
        more = ' and %d more' % (len(frames) - NAMED) if len(frames) > NAMED else ''
        fix = 'publish the pose of the camera: ' + _publisher_command('base_link', source)
        optical = [frame for frame in frames if is_optical(frame)]
        if optical:
            fix += '; or, if it has another name in tf: frame_id:=' + nearest_name(source, optical)
        return 'tf has no frame %s; its frames: %s%s' % (source, ', '.join(frames[:NAMED]), more), fix
    parents = {frame: link.parent for frame, link in links.items()}
    up, down = path_to_root(parents, source), path_to_root(parents, target)
    if target not in frames and is_optical(up[-1]):
        return 'tf has no frame %s; the tree of the camera is %s' % (target, ' < '.join(up)), pose_fix(up[-1])
    if target not in frames:
        fix = 'start the localisation of the robot in %s, or track in another frame: frame_world:=%s' % (target, up[-1])
        if up[-1] not in ROBOT_FRAMES:
            fix += ('; for a camera that is not on a robot: camera_height:=1.2 camera_tilt:=0.1 camera_root:=%s '
                    '(process_bag: --camera-height 1.2 --camera-tilt 0.1), or camera_pose:=floor (--camera-pose floor)'
                    % up[-1])
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


def pose_fix(frame):
    """How to publish the pose of a camera that is not on a robot; `frame` is its optical frame."""
    return ('publish its pose, here 1.2 m above the floor and tilted down by 0.1 rad: rosrun tf2_ros '
            'static_transform_publisher 0 0 1.2 -1.5708 0 -1.6708 map %s, and pass floor_frame:=map; the launch '
            'arguments camera_height:=1.2 camera_tilt:=0.1 frame_id:=%s do both; process_bag: --camera-height 1.2 '
            '--camera-tilt 0.1; or let camera_pose:=floor (--camera-pose floor) fit it to the floor' % (frame, frame))


def optical_frame_fix(links, frame):
    """How to correct the frame of images, or its transform, which have the axes of a body."""
    if is_optical(frame):
        return 'correct its transform: ' + _publisher_command(links[frame].parent, frame)
    optical = [other for other in links if is_optical(other)]
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
