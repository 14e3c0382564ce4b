"""Faults of topics: silence, stamps far from the current time, and stamps that do not match."""
from ros_3d_bb.core.params import nearest_name
from ros_3d_bb.core.time_sync import NS

LATE_S, EARLY_S = 5.0, 2.0  # tolerated time of a stamp before and after ROS time
LEAST_RATE_HZ = 4.0  # of images; tracks of walking people are lost at lower rates
LEAST_PAIRED = 0.5  # required fraction of boxes with a depth image of the same stamp
STANDSTILL = ('/use_sim_time is set and nothing comes on /clock: time stands still',
              'play the bag with rosbag play --clock, or rosparam set use_sim_time false, and start the nodes again')


def silence_fault(stream, topics, taken=(), seconds=5.0, is_bag=False):
    """Explain why no messages arrived on a topic.

    Parameters
    ----------
    stream : Stream
    topics : dict
        {name: type} of all published topics.
    taken : collection of str
        Topics that already have another role and are not suggested.
    seconds : float
        Duration of the observation.
    is_bag : bool
        Whether the topics are those of a bag.

    Returns
    -------
    str, str
        The fault and its fix.
    """
    role, topic = stream.role, stream.topic
    if stream.published_kind != role.kind:
        fault = ('%s has the type %s; %s expected' % (topic, stream.published_kind, role.kind) if stream.published_kind
                 else ('there is no %s in it' if is_bag else 'nobody publishes %s') % topic)
        return fault, _rename(stream, topics, taken, 'record it' if is_bag else 'start ' + role.source)
    if is_bag:
        return 'there is nothing on %s in the first %.0f s' % (topic, seconds), 'record it from the start'
    unreachable = [publisher for publisher in stream.publishers if publisher.problem]
    names = ', '.join(publisher.node for publisher in stream.publishers) or 'somebody'
    if unreachable:
        return ('nothing comes on %s: %s publishes it, but %s' % (topic, unreachable[0].node, unreachable[0].problem),
                'set ROS_IP on both machines to the address that the other one reaches (or let their names be known in '
                '/etc/hosts) and start the nodes again; of a node that is gone: rosnode cleanup')
    return ('nothing has come on %s for %.0f s, though %s publishes it' % (topic, seconds, names), role.when_silent)


def _rename(stream, topics, taken, start):
    role = stream.role
    others = [name for name, kind in topics.items() if kind == role.kind and name != stream.topic and name not in taken]
    if not others:
        return '%s; there is nothing else of the type %s' % (start, role.kind)
    other = nearest_name(stream.topic, sorted(others))
    launch = ' (launch argument %s:=%s)' % (role.argument, other) if role.argument else ''
    return '%s, or, if it is %s, remap %s:=%s%s' % (start, other, role.name, other, launch)


def clock_fault(stream, use_sim_time):
    """Explain why the stamps on a topic are far from ROS time.

    Returns
    -------
    str, str
        The fault and its fix; both empty if the stamps are within the tolerance.
    """
    lag_s = stream.lag_s
    if lag_s is None or -EARLY_S <= lag_s <= LATE_S:
        return '', ''
    fault = 'the stamps on %s are %s %s ROS time' % (stream.topic, span(abs(lag_s)), 'before' if lag_s > 0 else 'after')
    if use_sim_time and stream.machine_lag_s is not None and -EARLY_S <= stream.machine_lag_s <= LATE_S:
        return (fault + ', which comes from /clock; they are of the clock of the machine',
                'for a camera that runs now: rosparam set use_sim_time false, and start the nodes again')
    if use_sim_time:
        return fault + ', which comes from /clock', 'let only one bag or simulator publish /clock'
    if lag_s > 3600:
        return (fault + ', the clock of this machine',
                'a bag is played with rosbag play --clock, and rosparam set use_sim_time true before the nodes start')
    return (fault + ', the clock of this machine',
            'set the clocks of all machines by one of them (chrony); or what comes before takes that long')


def span(seconds):
    """Format a duration in a suitable unit, from seconds to days."""
    for unit, length_s in (('days', 86400.0), ('hours', 3600.0), ('minutes', 60.0)):
        if seconds >= 2 * length_s:
            return '%.1f %s' % (seconds / length_s, unit)
    return '%.1f s' % seconds


def paired_share(stamps_ns, among_ns, tolerance_s):
    """Return the fraction of stamps that match one of `among_ns` within a tolerance.

    Only stamps in the time range of `among_ns` are counted.

    Returns
    -------
    float or None
        None if there are no stamps in that range.
    """
    others = sorted(among_ns)
    tolerance_ns = int(tolerance_s * NS)
    covered = [stamp for stamp in stamps_ns if others and others[0] <= stamp <= others[-1]]
    if not covered:
        return None
    paired, at = 0, 0
    for stamp in sorted(covered):
        while at < len(others) and others[at] < stamp - tolerance_ns:
            at += 1
        paired += at < len(others) and others[at] <= stamp + tolerance_ns
    return paired / float(len(covered))
