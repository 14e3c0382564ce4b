"""Faults of topics: silence, stamps far from the current time, and stamps that do not match."""
import re

import numpy as np

from ros_3d_bb.conversions.camera_msgs import info_topic_beside
from ros_3d_bb.core.params import nearest_name
from ros_3d_bb.core.time_sync import NS, half_period_of
from ros_3d_bb.diagnosis.observations import COMPRESSED_IMAGE, IMAGE

LATE_S, EARLY_S = 5.0, 2.0  # tolerated time of a stamp before and after ROS time
MIN_RATE_HZ = 4.0  # of images; chosen: tracking was measured down to 2.5 Hz, and loses people who walk at 1 Hz or less
NOT_COLOR = re.compile(r'depth|(^|[/_])(ir|infra\d*)([/_]|$)', re.IGNORECASE)  # by names of drivers
MIN_PAIRED = 0.5  # required fraction of boxes with a depth image of the same stamp
NO_CLOCK = ('/use_sim_time is set, but there are no messages on /clock: ROS time stands still',
            'play the bag with rosbag play --clock, or rosparam set use_sim_time false, and restart the nodes')


def silence_fault(stream, topics, used=(), seconds=5.0, is_bag=False):
    """Return why no messages arrived on the topic of a Stream, and the fix.

    `topics` is {name: type} of all published topics, or of those of a bag; those in `used` have another role and are
    not suggested as replacement. `seconds` is the duration of the observation.
    """
    role, topic = stream.role, stream.topic
    if stream.published_kind not in role.kinds:
        missing = 'there is no %s in the bag' if is_bag else 'no publishers on %s'
        wrong_type = '%s has the type %s; %s expected' % (topic, stream.published_kind, ' or '.join(role.kinds))
        return (wrong_type if stream.published_kind else missing % topic,
                _rename(stream, topics, used, 'record it' if is_bag else 'start ' + role.source))
    if is_bag:
        return 'no messages on %s in the first %.0f s' % (topic, seconds), 'record it from the start'
    for publisher in stream.publishers:
        if publisher.problem:
            return ('no messages on %s: %s publishes it, but %s' % (topic, publisher.node, publisher.problem),
                    publisher.fix)
    names = ', '.join(publisher.node for publisher in stream.publishers) or 'a node'
    return 'no messages on %s for %.0f s, although %s publishes it' % (topic, seconds, names), role.when_silent


def _rename(stream, topics, used, start):
    role, other = stream.role, other_topic(stream, topics, used)
    if not other:
        return '%s; there is no other topic of the type %s' % (start, role.kind)
    launch = ' (launch argument %s:=%s)' % (role.argument, other) if role.argument else ''
    return '%s, or, if it is %s, remap %s:=%s%s' % (start, other, role.name, other, launch)


def other_topic(stream, topics, used=()):
    """Return the name of the topic that a Stream without messages probably has; empty if there is none.

    `topics` is {name: type}; those in `used` have another role. Depth is preferred for depth; for colour neither it
    nor infrared is, and a camera_info beside colour images.
    """
    role, is_depth = stream.role, 'depth' in stream.role.name
    others = sorted(name for name, kind in topics.items()
                    if kind in role.kinds and name != stream.topic and name not in used
                    and not ('/ros_3d_bb/' in name and kind.endswith('/Image'))  # debug images of this package
                    # image_transport publishes both transports of any image, but only one of them is usable
                    and (kind != COMPRESSED_IMAGE or name.endswith('/compressedDepth') == is_depth))
    others = [name for name in others if ('depth' in name.lower()) == is_depth] or others
    if not is_depth:
        colors = [name for name, kind in topics.items()
                  if kind in (IMAGE, COMPRESSED_IMAGE) and not NOT_COLOR.search(name)]
        preferred = set(colors + list(map(info_topic_beside, colors)))
        others = [name for name in others if name in preferred] or others
    return nearest_name(stream.topic, others) if others else ''


def clock_fault(stream, use_sim_time):
    """Return why the stamps of a Stream are far from ROS time, and the fix; empty if they are within the tolerance."""
    lag_s = stream.lag_s
    if lag_s is None or -EARLY_S <= lag_s <= LATE_S:
        return '', ''
    fault = 'the stamps on %s are %s %s ROS time, ' % (stream.topic, span(abs(lag_s)),
                                                       'before' if lag_s > 0 else 'after')
    if use_sim_time and stream.machine_lag_s is not None and -EARLY_S <= stream.machine_lag_s <= LATE_S:
        return (fault + 'which comes from /clock; they are from the clock of the machine',
                'for a live camera: rosparam set use_sim_time false, and restart the nodes')
    if use_sim_time:
        return fault + 'which comes from /clock', 'let only one bag or simulator publish /clock'
    if lag_s > 3600:
        return (fault + 'the clock of this machine',
                'play bags with rosbag play --clock, and rosparam set use_sim_time true before the nodes start')
    return (fault + 'the clock of this machine',
            'synchronise the clocks of all machines (chrony)'
            + ('; or the preceding nodes take that long' if lag_s > 0 else ''))


def publishers_fault(names, nodes):
    """Return that several nodes publish the same topics, or frames of tf, and the fix."""
    return ('%s publish %s at once' % (' and '.join(nodes), ', '.join(names)),
            'stop all of them but one (rosnode kill NODE), or let them publish other names')


def span(seconds):
    """Format a duration in a suitable unit, from seconds to days."""
    for unit, length_s in (('days', 86400.0), ('hours', 3600.0), ('minutes', 60.0)):
        if seconds >= 2 * length_s:
            return '%.1f %s' % (seconds / length_s, unit)
    return '%.1f s' % seconds


def paired_share(stamps_ns, among_ns, tolerance_s):
    """Return the fraction of stamps that match one of `among_ns` within a tolerance; 0: `time_sync.half_period_of`.

    Only stamps in the time range of `among_ns` are counted. Returns None if there are none.
    """
    if not among_ns:
        return None
    stamps, others = np.array(stamps_ns, np.int64), np.sort(among_ns)
    tolerance_ns = int(tolerance_s * NS) or half_period_of(others.tolist())
    covered = stamps[(others[0] <= stamps) & (stamps <= others[-1])]
    if not covered.size:
        return None
    first = np.searchsorted(others, covered - tolerance_ns)  # candidates in the tolerance are others[first:end]
    end = np.searchsorted(others, covered + tolerance_ns, 'right')
    return float(np.mean(first < end))
