"""Report of a soak as tables and as JSON."""
import collections

import numpy as np

from ros_3d_bb.conversions.camera_msgs import COLOR_TOPIC
from ros_3d_bb.conversions.perception_msgs import BOXES3D_TOPIC, BOXES_TOPIC, TRACKS_TOPIC
from ros_3d_bb_lab.evaluation.defaults import describe_machine
from soak.invariants import (BALANCES, balance_of, cpu_ms_of, findings_of, growth_of, lags_of, last_of_each,
                             processes_of)

TOPICS = {'yolov5_node': COLOR_TOPIC, 'depth_detector_node': COLOR_TOPIC, 'bbox3d_node': BOXES_TOPIC,
          'tracker_node': BOXES3D_TOPIC, 'planner_bridge_node': TRACKS_TOPIC}
SHOWN = 5  # violations of an invariant


def report(record, arguments):
    """Print the tables and return all results for JSON. Times are seconds since the start."""
    def since(at_s):
        return None if at_s is None else at_s - record.began_s

    images_ns = set(stamp_ns for stamp_ns, sent_s in record.images if sent_s >= record.began_s)
    answered = len(images_ns & set(stamp_ns for _at_s, stamp_ns in record.arrivals[TRACKS_TOPIC]))
    print('%s\n%.1f minutes, seed %d, %g images per second, detector %s'
          % (describe_machine(), since(record.ended_s) / 60, arguments.seed, arguments.rate, arguments.detector))
    print('%d images sent, %d answered with tracks; %d messages of tracks arrived, %d of them empty'
          % (len(images_ns), answered, len(record.arrivals[TRACKS_TOPIC]), record.empty[TRACKS_TOPIC]))
    for table in (_faults, _inputs, _processes):
        print('\n' + '\n'.join(table(record)))

    print('\ninvariants')
    findings = findings_of(record, arguments.recover_within)
    for finding in findings:
        print('%-7s %-36s %s (limit: %s)' % (('BROKEN' if finding.broken else 'holds',) + finding[:3]))
        for at_s, text in finding.broken[:SHOWN]:
            print('        at %d:%04.1f: %s' % (divmod(max(0.0, since(at_s)), 60) + (text,)))
        if len(finding.broken) > SHOWN:
            print('        and %d more' % (len(finding.broken) - SHOWN))
    return {
        'machine': describe_machine(), 'minutes': since(record.ended_s) / 60, 'seed': arguments.seed,
        'rate_hz': arguments.rate, 'detector': arguments.detector, 'images': len(images_ns), 'sent': record.sent,
        'arrays': {topic: len(arrivals) for topic, arrivals in record.arrivals.items()}, 'empty': record.empty,
        'faults': [{'name': fault.name, 'began_s': since(fault.began_s), 'ended_s': since(fault.ended_s),
                    'recovered_s': since(fault.recovered_s)} for fault in record.finished_faults],
        'processes': [{'node': last.node, 'pid': last.pid, 'counts': last.counts,
                       'memory_mb': [(since(status.at_s), status.rss_mb) for status in record.statuses
                                     if status.pid == last.pid]} for last in last_of_each(record.statuses)],
        'latency_ms': [np.percentile(lags[:, 1], (50, 95)).tolist() if len(lags) else None for lags in lags_of(record)],
        'invariants': [{'name': finding.name, 'holds': not finding.broken, 'measured': finding.measured,
                        'limit': finding.limit,
                        'broken': [{'at_s': since(at_s), 'what': text} for at_s, text in finding.broken]}
                       for finding in findings]}


def _faults(record):
    rows = ['%-36s %5s %10s %24s' % ('fault', 'count', 'duration s', 'recovery s: median, longest')]
    kinds = collections.defaultdict(list)
    for fault in record.finished_faults:
        took_s = np.inf if fault.recovered_s is None else fault.recovered_s - fault.ended_s
        kinds[fault.name].append((fault.ended_s - fault.began_s, took_s))
    for name, times_s in sorted(kinds.items()):
        lasted_s, took_s = np.array(times_s).T
        rows.append('%-36s %5d %10.1f %24.2f %7.2f' % (name, len(took_s), np.median(lasted_s), np.median(took_s),
                                                       took_s.max()))
    return rows


def _inputs(record):
    """A node is sent what the node before it published, and invalid messages."""
    totals, reasons = collections.OrderedDict(), collections.Counter()
    for status in last_of_each(record.statuses):
        totals[status.node] = totals.get(status.node, 0) + np.array(balance_of(status))
        for reason in BALANCES[status.node].reasons:
            reasons[status.node, reason] += status.counts.get(reason, 0)
    rows, before = ['%-22s %-14s %8s %8s %10s %8s %11s' % (
        'inputs of', '', 'sent', 'received', 'published', 'not', 'in progress')], 0
    for node in (node for node in BALANCES if node in totals):
        row = (node, BALANCES[node].received, before + record.sent.get(TOPICS[node], 0)) + tuple(totals[node])
        rows.append('%-22s %-14s %8d %8d %10d %8d %11d' % row)
        before = totals[node][1]
    return rows + ['not published by %-22s %6d %s' % (node, count, reason)
                   for (node, reason), count in reasons.items() if count]


def _processes(record):
    rows = ['%-22s %9s %9s %9s %9s %10s %11s' % ('process of', 'minutes', 'MB start', 'MB end', 'risen MB', 'ms/image',
                                                 'then')]
    for (node, _pid), statuses in processes_of(record).items():
        halves_ms = cpu_ms_of(record, statuses)
        rows.append('%-22s %9.1f %9.1f %9.1f %9.1f %10s %11s' % (
            (node, (statuses[-1].at_s - statuses[0].at_s) / 60, statuses[0].rss_mb, statuses[-1].rss_mb,
             growth_of(record, statuses)[1])
            + (('-', '-') if halves_ms is None else tuple('%.1f' % part_ms for part_ms in halves_ms))))
    return rows
