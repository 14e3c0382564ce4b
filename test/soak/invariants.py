"""What has to hold whatever happens. Each function takes a `Record` and returns a `Finding`."""
import collections
from typing import List, NamedTuple, Tuple

import numpy as np


BEHIND_S = 3.0  # messages of the time before a jump may be heard so long after the first answer
LONGEST_UNSEEN_S = 4.0  # ~max_age of the tracker: nobody is published longer than they are remembered
WAITING_AT_END = 3  # inputs without an outcome yet: at work, or waiting for the other half of their pair
WAITING = 103  # the same in the middle of a fault: what `stamped.Pairing` lets wait, and the worker
WARM_UP_S = 60.0  # caches fill, and libraries take what they keep
WARM_UP_SHARE = 0.15  # of the whole, where that is shorter
LEAST_SAMPLES = 20  # of memory or CPU, to say anything
RISE_MB = 20.0  # of the most memory that a process ever held
HELD_MB = 150.0  # more than after the warm-up, whatever the reason: images that came while it hung
CPU_RATIO, CPU_MORE_MS = 2.0, 5.0
LAG_IMAGES = 3.0
SHORTEST_S = 60.0  # a soak that was ended before has too few answers to compare


class Finding(NamedTuple):
    """How one invariant fared: what was measured, the limit, and where it was broken, [(at_s, what), ...]."""

    name: str
    measured: str
    limit: str
    broken: List[Tuple[float, str]]


class Balance(NamedTuple):
    """An input of a node, and its outcomes: published, of which some are empty, or not, for a reason."""

    received: str
    published: str
    reasons: Tuple[str, ...]


BALANCES = {
    'yolov5_node': Balance('colour images', 'images processed', (
        'images rejected', 'images skipped for a newer one', 'images while paused', 'detections failed')),
    'depth_detector_node': Balance('colour images', 'images processed', (
        'colour images rejected', 'colour images without depth', 'colour images of a time before', 'images rejected',
        'images skipped for a newer one', 'images without floor', 'images while paused', 'detections failed')),
    'bbox3d_node': Balance('2D boxes', 'images estimated', ('2D boxes rejected', '2D boxes from before a time jump')),
    'tracker_node': Balance('3D boxes', 'images tracked', (
        '3D boxes rejected', 'no transform', 'images behind other cameras', 'images ahead of other cameras')),
    'planner_bridge_node': Balance('tracks', 'tracks forwarded', ('tracks rejected',))}


def balance_of(status):
    """(received, published, for a reason not published, without an outcome yet) of a Status."""
    balance = BALANCES[status.node]
    received = status.counts.get('%s received' % balance.received, 0)
    published = status.counts.get(balance.published, 0)
    reasons = sum(status.counts.get(reason, 0) for reason in balance.reasons)
    return received, published, reasons, received - published - reasons


def every_input_has_an_outcome(record):
    """By the nodes' own counts, each time that they told them."""
    broken, totals = [], np.zeros(4, int)
    for status in record.statuses:
        found = balance_of(status)
        if not 0 <= found[3] <= WAITING:
            broken.append((status.at_s, '%s: %d %s came, %d were published, %d not for a reason; %d have no outcome'
                           % ((status.node, found[0], BALANCES[status.node].received) + found[1:])))
    for status in last_of_each(record):
        found = balance_of(status)
        totals += found
        if found[3] > WAITING_AT_END and not _was_killed(record, status):
            broken.append((status.at_s, '%s: %d inputs have no outcome at the end' % (status.node, found[3])))
    return Finding('each input has an outcome', '%d inputs of nodes: %d published or empty, %d not for a reason, %d at '
                   'work when last heard' % tuple(totals), 'at most %d at work at the end' % WAITING_AT_END, broken)


def outcomes_are_known(statuses):
    """Whether no node had inputs without an outcome when it was heard last, but for a few."""
    newest = {status.node: status for status in statuses}
    return all(balance_of(status)[3] <= WAITING_AT_END for status in newest.values())


def last_of_each(record):
    """The last Status of each process of each node."""
    last = collections.OrderedDict()
    for status in record.statuses:
        last[status.node, status.pid] = status
    return list(last.values())


def _was_killed(record, status):
    return status.pid in record.killed


def stamps_do_not_go_back(record):
    """But where a fault made time go back, or sent wrong stamps, between the two messages."""
    broken, count = [], 0
    for topic, arrivals in record.arrivals.items():
        for (before_s, before_ns), (at_s, stamp_ns) in zip(arrivals, arrivals[1:]):
            count += 1
            if stamp_ns < before_ns and not any(fault.disturbs and fault.overlaps(before_s, at_s, BEHIND_S)
                                                for fault in record.faults):
                broken.append((at_s, '%s: %.3f after %.3f' % (topic, stamp_ns * 1e-9, before_ns * 1e-9)))
    return Finding('no stamp older than its predecessor', '%d pairs of messages' % count,
                   'none older, but where a fault made it so', broken)


def stamps_are_those_of_images(record):
    """Nothing is stamped with a time at which no image (and no wrong message) was sent."""
    sent_ns = set(stamp_ns for stamp_ns, _sent_s in record.images) | record.wrong_ns
    broken = [(at_s, '%s: nothing was sent with the stamp %.9f' % (topic, stamp_ns * 1e-9))
              for topic, arrivals in record.arrivals.items() for at_s, stamp_ns in arrivals if stamp_ns not in sent_ns]
    return Finding('stamps are those of images', '%d messages' % sum(map(len, record.arrivals.values())),
                   'all of messages that were sent', broken)


def numbers_are_not_reused(record):
    """A track keeps the time at which it was first seen; another one of the same number would have another."""
    broken, first_ns = [], {}
    for at_s, _stamp_ns, tracks in record.tracks:
        for track in tracks:
            if first_ns.setdefault(track.id, track.first_ns) != track.first_ns:
                broken.append((at_s, 'number %d was first seen at %.3f, and before that at %.3f'
                               % (track.id, track.first_ns * 1e-9, first_ns[track.id] * 1e-9)))
                first_ns[track.id] = track.first_ns
    return Finding('numbers of tracks are not reused', '%d numbers' % len(first_ns), 'each one track', broken)


def nobody_outlasts_memory(record):
    """Nobody is of a time that has not come, or was not seen for longer than people are remembered."""
    broken, oldest_s = [], 0.0
    for at_s, stamp_ns, tracks in record.tracks:
        for track in tracks:
            unseen_s = (stamp_ns - track.last_ns) * 1e-9
            oldest_s = max(oldest_s, unseen_s)
            if not track.first_ns <= track.last_ns <= stamp_ns or unseen_s > LONGEST_UNSEEN_S:
                broken.append((at_s, 'track %d at %.3f: first seen %.3f, last %.3f' % (
                    track.id, stamp_ns * 1e-9, track.first_ns * 1e-9, track.last_ns * 1e-9)))
    return Finding('nobody is shown beyond the memory', 'unseen for %.2f s at most' % oldest_s,
                   '%.1f s' % LONGEST_UNSEEN_S, broken)


def nobody_dies_of_a_message(record):
    """Processes end only where they are killed, and no exception is left to rospy or to the detector's worker."""
    broken = [(death.at_s, '%s (process %d) %s' % (death.node, death.pid, death.how))
              for death in record.deaths if death.pid not in record.killed]
    broken += [(at_s, text) for at_s, text in record.errors]
    broken += [(status.at_s, '%s: %d detections failed' % (status.node, status.counts['detections failed']))
               for status in last_of_each(record) if status.counts.get('detections failed')]
    return Finding('nobody dies of a message', '%d killed, %d died, %d exceptions'
                   % (len(record.killed), len([1 for death in record.deaths if death.pid not in record.killed]),
                      len(record.errors)), 'only who is killed', broken)


def warm_up_s(record):
    """How long a process warms up."""
    return min(WARM_UP_S, WARM_UP_SHARE * (record.ended_s - record.began_s))


def processes_of(record):
    """{(node, pid): [Status, ...]} of the processes, without what each needs to warm up."""
    processes, began_s = collections.OrderedDict(), {}
    for status in record.statuses:
        key = status.node, status.pid
        if status.at_s >= began_s.setdefault(key, status.at_s) + warm_up_s(record):
            processes.setdefault(key, []).append(status)
    return {key: statuses for key, statuses in processes.items() if len(statuses) >= LEAST_SAMPLES}


class Growth(NamedTuple):
    """Memory of a process: seconds, megabytes at the start and the end, slope of the fitted line, by how much the most
    that it held rose, and how much of that without a reason.
    """

    seconds: float
    first_mb: float
    last_mb: float
    mb_per_minute: float
    held_mb: float
    risen_mb: float


def growth_of(record, statuses):
    """The Growth of a process.

    A fault may take memory once, as queues fill that were never full before; when it comes again, and between the
    faults, the most that was ever taken has to do. How many images a process takes at once after it hung is chance:
    that only has a bound.
    """
    times_s, rss_mb = np.array([(status.at_s, status.rss_mb) for status in statuses]).T
    slope = np.polyfit(times_s - times_s[0], rss_mb, 1)[0]
    born_s = times_s[0] - warm_up_s(record)
    faults = [fault for fault in record.faults if fault.began_s >= born_s]
    first_of = {fault.name: number for number, fault in reversed(list(enumerate(faults)))}
    begun = np.searchsorted([fault.began_s for fault in faults], times_s, side='right') - 1  # the latest, -1: none
    rises_mb = np.diff(np.maximum.accumulate(rss_mb))
    hung = '%s hangs' % statuses[0].node
    counts = [number < 0 or first_of[faults[number].name] != number and faults[number].name != hung
              for number in begun[1:]]
    return Growth(float(times_s[-1] - times_s[0]), float(rss_mb[0]), float(rss_mb[-1]), float(60 * slope),
                  float(rises_mb.sum()), float(rises_mb[np.array(counts, bool)].sum()))


def memory_is_flat(record):
    """Of each process after its warm-up, see `growth_of`."""
    growths = {key: growth_of(record, statuses) for key, statuses in processes_of(record).items()}
    broken = [(record.ended_s, '%s (process %d): %+.1f MB in %.0f s, %+.1f MB of them without a reason'
               % (key + (growth.held_mb, growth.seconds, growth.risen_mb)))
              for key, growth in growths.items() if growth.risen_mb > RISE_MB or growth.held_mb > HELD_MB]
    held, risen = (max([getattr(growth, name) for growth in growths.values()], default=0.0)
                   for name in ('held_mb', 'risen_mb'))
    return Finding('memory is flat', '%d processes, %+.1f MB at most, %+.1f MB of a process without a reason'
                   % (len(growths), held, risen), '%+.0f MB, %+.0f MB' % (HELD_MB, RISE_MB), broken)


def cpu_ms_of(record, statuses):
    """CPU time for each published answer, in steps between two statuses without a fault, (n, 2): seconds, answers."""
    steps = []
    for before, after in zip(statuses, statuses[1:]):
        answers = balance_of(after)[1] - balance_of(before)[1]
        if answers > 0 and record.is_quiet(before.at_s) and record.is_quiet(after.at_s):
            steps.append((after.cpu_s - before.cpu_s, answers))
    return np.array(steps).reshape(-1, 2)


def halves_ms(steps):
    """CPU time for an answer in the first and in the second half of steps, milliseconds."""
    half = len(steps) // 2
    return tuple(float(1e3 * part[:, 0].sum() / part[:, 1].sum()) for part in (steps[:half], steps[half:]))


def cpu_is_flat(record):
    """Of each process, the second half of its life against the first, outside of faults."""
    broken, worst = [], 0.0
    found = {key: cpu_ms_of(record, statuses) for key, statuses in processes_of(record).items()}
    found = {key: halves_ms(steps) for key, steps in found.items() if len(steps) >= LEAST_SAMPLES}
    for key, (first_ms, last_ms) in found.items():
        worst = max(worst, last_ms / max(first_ms, 1.0))
        if last_ms > CPU_RATIO * first_ms + CPU_MORE_MS:
            broken.append((record.ended_s, '%s (process %d): %.1f ms an image, then %.1f ms'
                           % (key + (first_ms, last_ms))))
    return Finding('CPU time of an image is flat', '%d processes, %.2f times as much at most' % (len(found), worst),
                   '%.0f times and %.0f ms' % (CPU_RATIO, CPU_MORE_MS), broken)


def lags_of(record):
    """When tracks came while no fault was there, how many images had been sent since theirs, and how long that took.

    Returns
    -------
    numpy.ndarray, (n, 3)
        Seconds, images, milliseconds.
    """
    number_of = {stamp_ns: number for number, (stamp_ns, _sent_s) in enumerate(record.images)}
    sent_s = np.array([sent_s for _stamp_ns, sent_s in record.images])
    lags = [(at_s, np.searchsorted(sent_s, at_s) - 1 - number_of[stamp_ns],
             1e3 * (at_s - sent_s[number_of[stamp_ns]]))
            for at_s, stamp_ns, _tracks in record.tracks
            if stamp_ns in number_of and record.is_quiet(at_s) and record.is_quiet(sent_s[number_of[stamp_ns]])]
    return np.array(lags).reshape(-1, 3)


def thirds_of(record, lags):
    """Those of `lags_of` in the first and in the last third of the time."""
    third_s = (record.ended_s - record.began_s) / 3
    return lags[lags[:, 0] < record.began_s + third_s], lags[lags[:, 0] >= record.ended_s - third_s]


def queues_do_not_grow(record):
    """Counted in images, as the time that one takes is the machine's."""
    first, last = thirds_of(record, lags_of(record))
    limit = '%.0f more' % LAG_IMAGES
    if not len(first) or not len(last):
        long_enough = record.ended_s - record.began_s > SHORTEST_S
        return Finding('queues do not grow', 'too few answers to compare', limit,
                       [(record.ended_s, 'no answers without a fault')] if long_enough else [])
    medians = np.median(first, axis=0)[1:].tolist() + np.median(last, axis=0)[1:].tolist()
    broken = []
    if medians[2] > medians[0] + LAG_IMAGES:
        broken.append((record.ended_s, '%.0f images behind in the last third, %.0f in the first'
                       % (medians[2], medians[0])))
    return Finding('queues do not grow', '%.0f images (%.0f ms) behind in the first third, %.0f (%.0f ms) in the last'
                   % tuple(medians), limit, broken)


def it_recovers(within_s):
    """The invariant that an image that is sent so soon after a fault's cause ended is answered."""
    def it_recovers_in_time(record):
        faults = record.finished_faults
        broken = [(fault.ended_s, '%s: %s' % (fault.name, 'never' if fault.recovered_s is None else '%.2f s'
                                              % (fault.recovered_s - fault.ended_s)))
                  for fault in faults if fault.recovered_s is None or fault.recovered_s - fault.ended_s > within_s]
        took_s = [fault.recovered_s - fault.ended_s for fault in faults if fault.recovered_s is not None]
        measured = '%d faults, median %.2f s, longest %.2f s' % (len(faults), np.median(took_s), max(took_s)
                                                                 ) if took_s else 'no recovery'
        return Finding('it recovers', measured, '%.1f s' % within_s, broken)
    return it_recovers_in_time


def findings_of(record, within_s):
    """All of them."""
    return [check(record) for check in (
        every_input_has_an_outcome, stamps_do_not_go_back, stamps_are_those_of_images, numbers_are_not_reused,
        nobody_outlasts_memory, nobody_dies_of_a_message, it_recovers(within_s), queues_do_not_grow, memory_is_flat,
        cpu_is_flat)]
