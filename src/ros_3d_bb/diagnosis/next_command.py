"""The next command on the way from a bag to its tracks, and to a picture of them."""
from shlex import quote

from ros_3d_bb.diagnosis.checks import COLOR, IMAGES, TRACKS
from ros_3d_bb.diagnosis.topic_faults import other_topic

MIN_ROLL_RAD = 0.02  # smaller ones are within the error of the fitted floor


def next_command(bag, seen, found):
    """Return the next command for a bag, and what it does; ('', '') if a fault must be fixed first.

    `seen` are the Observations of the bag, and `found` the list of Finding on them.
    """
    names = {stream.role.name: stream.topic for stream in seen.streams.values()
             if stream.count and stream.topic.lstrip('/') != stream.role.name}
    missing = [seen.streams[key] for key in IMAGES if not seen.streams[key].count]
    others = {stream.role.name: other_topic(stream, seen.topics, names.values()) for stream in missing}
    color = dict(names, **others).get(seen.streams[COLOR].role.name)
    report = 'rosrun ros_3d_bb scene_report %s' + (' --color-topic ' + quote(color) if color else '')
    if seen.streams[TRACKS].count:
        return report % quote(bag), 'draws the tracks'
    if missing and all(others.values()):
        return ('rosrun ros_3d_bb doctor %s%s' % (quote(bag), _remappings(dict(names, **others))),
                'checks the topics that probably are the missing ones')
    faults = set(finding.subject for finding in found if finding.fault)
    if missing or faults - {'transforms', 'image rotation'}:
        return '', ''
    pose, hint = _pose(seen.mount) if faults else ('', '')
    command = 'rosrun ros_3d_bb process_bag %s tracked.bag --detector depth%s%s && %s' % (
        quote(bag), _remappings(names, ' --remap '), pose, report % 'tracked.bag')
    return command, 'tracks people and draws them' + hint


def _pose(mount):
    """Return the options for the pose of a camera without tf, from its CameraMount or None, and a hint."""
    turned = ' --image-rotation %d' % (90 * mount.turns) if mount is not None and mount.turns else ''
    if mount is None or mount.height_m is None:
        return (' --camera-height HEIGHT --camera-tilt TILT' + turned,
                '; fill in the height of the camera above the floor, metres, and its tilt, radians, positive if it '
                'looks down')
    roll = ' --camera-roll %.2f' % mount.roll_rad if abs(mount.roll_rad) > MIN_ROLL_RAD else ''
    return (' --camera-height %.2f --camera-tilt %.2f%s%s' % (mount.height_m, mount.tilt_rad, roll, turned),
            '; height and tilt are those of the floor in the depth images: correct them if they are known')


def _remappings(names, separator=' '):
    return ''.join('%s%s:=%s' % (separator, name, topic) for name, topic in sorted(names.items()))
