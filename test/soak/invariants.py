"""Invariants of a soak. Each check takes a `Record` and returns a `Finding`."""
import collections
from typing import List, NamedTuple, Tuple

import numpy as np


BEHIND_S = 3.0  # messages from before a jump in time may arrive this much later than the first answer
LONGEST_UNSEEN_S = 4.0  # ~max_age of the tracker
WAITING_AT_END = 3  # inputs without an outcome: in progress, or waiting for the other half of their pair
WAITING = 103  # the same during a fault: capacity of `StampSynchronizer` and the worker
WARM_UP_S, WARM_UP_SHARE = 60.0, 0.15  # start of a process, which is excluded; share of a short soak
LEAST_SAMPLES = 20  # of memory, for a finding
RISE_MB = 20.0  # limit of the rise of the memory maximum without a known cause
HELD_MB = 150.0  # limit of the rise from any cause: images that arrive while a process hangs


class Finding(NamedTuple):
    """Result of a check: measured value, limit, and violations [(at_s, text), ...]."""

    name: str
    measured: str
    limit: str
    broken: List[Tuple[float, str]]


class Balance(NamedTuple):
    """Counters of an input of a node: received, published (some are empty), and reasons for not being published."""

    received: str
    published: str
    reasons: Tuple[str, ...]


BALANCES = {
    'yolov5_node': Balance('colour images', 'images processed', (
        'images rejected', 'images skipped for a newer one', 'images while paused', 'detections failed')),
    'depth_detector_node': Balance('colour images', 'images processed', (
        'colour images rejected', 'colour images from before a time jump', 'images rejected',
        'images skipped for a newer one', 'images without floor', 'images while paused', 'detections failed')),
    'bbox3d_node': Balance('2D boxes', 'images estimated', ('2D boxes rejected', '2D boxes from before a time jump')),
    'tracker_node': Balance('3D boxes', 'images tracked', (
        '3D boxes rejected', 'no transform', 'images behind other cameras', 'images ahead of other cameras')),
    'planner_bridge_node': Balance('tracks', 'tracks forwarded', ('tracks rejected',))}


def balance_of(status):
    """(received, published, rejected or skipped, without an outcome yet): numbers of inputs of a Status."""
    balance = BALANCES[status.node]
    received = status.counts.get('%s received' % balance.received, 0)
    published = status.counts.get(balance.published, 0)
    reasons = sum(status.counts.get(reason, 0) for reason in balance.reasons)
    return received, published, reasons, received - published - reasons


def every_input_has_an_outcome(record):
    """By the counters of the nodes, at any time and at the end of each process that was not killed."""
    broken = [(status.at_s, '%s: %d inputs, %d published, %d rejected, %d without an outcome'
               % ((status.node,) + balance_of(status)))
              for status in record.statuses if not 0 <= balance_of(status)[3] <= WAITING]
    last = last_of_each(record.statuses)
    broken += [(status.at_s, '%s: %d inputs without an outcome at the end' % (status.node, balance_of(status)[3]))
               for status in last if balance_of(status)[3] > WAITING_AT_END and status.pid not in record.killed]
    totals = np.sum([balance_of(status) for status in last], axis=0) if last else np.zeros(4)
    return Finding('each input has an outcome', '%d inputs: %d published or empty, %d rejected, %d in progress'
                   % tuple(totals), 'at most %d in progress at the end' % WAITING_AT_END, broken)


def outcomes_are_known(statuses):
    """Whether the latest counters of all nodes leave few inputs without an outcome."""
    newest = {status.node: status for status in statuses}
    return all(balance_of(status)[3] <= WAITING_AT_END for status in newest.values())


def last_of_each(statuses):
    """The last Status of each process."""
    return list(collections.OrderedDict(((status.node, status.pid), status) for status in statuses).values())


def stamps_do_not_decrease(record):
    """Except if a fault that makes time jump, or sends wrong stamps, lies between the two messages."""
    pairs = [(topic,) + before + after for topic, arrivals in record.arrivals.items()
             for before, after in zip(arrivals, arrivals[1:])]
    broken = [(at_s, '%s: %.3f after %.3f' % (topic, stamp_ns * 1e-9, before_ns * 1e-9))
              for topic, before_s, before_ns, at_s, stamp_ns in pairs
              if stamp_ns < before_ns and not any(fault.disorders and fault.overlaps(before_s, at_s, BEHIND_S)
                                                  for fault in record.faults)]
    return Finding('stamps do not decrease', '%d pairs of messages' % len(pairs), 'none, except by a fault', broken)


def stamps_are_those_of_images(record):
    """Each stamp is that of an image or of an invalid message."""
    sent_ns = set(stamp_ns for stamp_ns, _sent_s in record.images) | record.wrong_ns
    broken = [(at_s, '%s: nothing was sent with the stamp %.9f' % (topic, stamp_ns * 1e-9))
              for topic, arrivals in record.arrivals.items() for at_s, stamp_ns in arrivals if stamp_ns not in sent_ns]
    return Finding('stamps are those of images', '%d messages' % sum(map(len, record.arrivals.values())),
                   'all of messages that were sent', broken)


def ids_are_not_reused(record):
    """A track keeps the time at which it was first seen; another track with the same ID would have another one."""
    broken, first_ns = [], {}
    for at_s, _stamp_ns, tracks in record.tracks:
        for track in tracks:
            if first_ns.setdefault(track.id, track.first_ns) != track.first_ns:
                broken.append((at_s, 'track %d was first seen at %.3f, and before that at %.3f'
                               % (track.id, track.first_ns * 1e-9, first_ns[track.id] * 1e-9)))
                first_ns[track.id] = track.first_ns
    return Finding('track IDs are not reused', '%d IDs' % len(first_ns), 'each one track', broken)


def tracks_do_not_outlive_max_age(record):
    """No track is seen in the future, or was last seen longer ago than the tracker's max_age."""
    broken, oldest_s = [], 0.0
    for at_s, stamp_ns, tracks in record.tracks:
        for track in tracks:
            unseen_s = (stamp_ns - track.last_ns) * 1e-9
            oldest_s = max(oldest_s, unseen_s)
            if not track.first_ns <= track.last_ns <= stamp_ns or unseen_s > LONGEST_UNSEEN_S:
                broken.append((at_s, 'track %d at %.3f: first seen %.3f, last %.3f' % (
                    track.id, stamp_ns * 1e-9, track.first_ns * 1e-9, track.last_ns * 1e-9)))
    return Finding('tracks do not outlive max_age', 'unseen for at most %.2f s' % oldest_s, '%.1f s' % LONGEST_UNSEEN_S,
                   broken)


def no_message_crashes_a_node(record):
    """Processes end only if they are killed, and there are no uncaught exceptions in callbacks or in workers."""
    crashes = [(at_s, text) for at_s, pid, text in record.deaths if pid not in record.killed]
    failures = [(status.at_s, '%s: %d detections failed' % (status.node, status.counts['detections failed']))
                for status in last_of_each(record.statuses) if status.counts.get('detections failed')]
    return Finding('no message crashes a node', '%d killed, %d crashed, %d exceptions'
                   % (len(record.killed), len(crashes), len(record.errors)), 'no crash, no exception',
                   crashes + record.errors + failures)


def processes_of(record):
    """{(node, pid): [Status, ...]} without the warm-up of each process, if there are enough samples."""
    processes, began_s = collections.OrderedDict(), {}
    for status in record.statuses:
        key = status.node, status.pid
        if status.at_s >= began_s.setdefault(key, status.at_s) + _warm_up_s(record):
            processes.setdefault(key, []).append(status)
    return {key: statuses for key, statuses in processes.items() if len(statuses) >= LEAST_SAMPLES}


def _warm_up_s(record):
    return min(WARM_UP_S, WARM_UP_SHARE * (record.ended_s - record.began_s))


def growth_of(record, statuses):
    """Rise of the memory maximum of a process, and the part of it without a known cause, in megabytes.

    The first fault of a kind may fill queues that were never full before; a later one of the kind may not take more
    memory, nor may the time between faults. How many images a process reads at once after it hung depends on chance.
    """
    times_s, rss_mb = np.array([(status.at_s, status.rss_mb) for status in statuses]).T
    faults = [fault for fault in record.faults if fault.began_s >= times_s[0] - _warm_up_s(record)]
    first_of = {fault.name: number for number, fault in reversed(list(enumerate(faults)))}
    latest = np.searchsorted([fault.began_s for fault in faults], times_s, side='right') - 1  # -1: none
    rises_mb = np.diff(np.maximum.accumulate(rss_mb))
    without_cause = [number < 0 or (first_of[faults[number].name] != number
                                    and faults[number].name != '%s hangs' % statuses[0].node)
                     for number in latest[1:]]
    return float(rises_mb.sum()), float(rises_mb[np.array(without_cause, bool)].sum())


def memory_is_flat(record):
    """Of each process after its warm-up, see `growth_of`."""
    growths = {key: growth_of(record, statuses) for key, statuses in processes_of(record).items()}
    broken = [(record.ended_s, '%s (process %d): %+.1f MB, %+.1f MB of them without a known cause'
               % (key + (held_mb, risen_mb)))
              for key, (held_mb, risen_mb) in growths.items() if risen_mb > RISE_MB or held_mb > HELD_MB]
    worst = tuple(np.max(list(growths.values()), axis=0)) if growths else (0.0, 0.0)
    return Finding('memory is flat', '%d processes, at most %+.1f MB, %+.1f MB without a known cause'
                   % ((len(growths),) + worst), '%+.0f MB, %+.0f MB' % (HELD_MB, RISE_MB), broken)


def graph_recovers(record, within_s):
    """An image that is sent after the end of a fault's cause is answered within some seconds."""
    took_s = [(fault, np.inf if fault.recovered_s is None else fault.recovered_s - fault.ended_s)
              for fault in record.finished_faults]
    broken = [(fault.ended_s, '%s: %.2f s' % (fault.name, seconds)) for fault, seconds in took_s if seconds > within_s]
    times_s = [seconds for _fault, seconds in took_s]
    measured = '%d faults, median %.2f s, longest %.2f s' % (
        len(times_s), np.median(times_s), max(times_s)) if times_s else 'no fault'
    return Finding('the graph recovers', measured, '%.1f s' % within_s, broken)


CHECKS = (every_input_has_an_outcome, stamps_do_not_decrease, stamps_are_those_of_images, ids_are_not_reused,
          tracks_do_not_outlive_max_age, no_message_crashes_a_node, memory_is_flat)


def findings_of(record, within_s):
    """Findings of all checks."""
    return [graph_recovers(record, within_s)] + [check(record) for check in CHECKS]
