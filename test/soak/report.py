"""How a soak fared, as tables and as JSON."""
import collections

import numpy as np

from ros_3d_bb.conversions.camera_msgs import COLOR_TOPIC
from ros_3d_bb.conversions.perception_msgs import BOXES3D_TOPIC, BOXES_TOPIC, TRACKS_TOPIC
from ros_3d_bb_lab.evaluation.machine import describe_machine
from soak.invariants import (BALANCES, balance_of, cpu_ms_of, findings_of, growth_of, halves_ms, lags_of, last_of_each,
                             processes_of, thirds_of)

TOPICS = {'yolov5_node': COLOR_TOPIC, 'depth_detector_node': COLOR_TOPIC, 'bbox3d_node': BOXES_TOPIC,
          'tracker_node': BOXES3D_TOPIC, 'planner_bridge_node': TRACKS_TOPIC}
SHOWN = 5  # of the places where an invariant was broken


def print_report(record, empty, arguments):
    """Print the tables. Returns the findings."""
    findings = findings_of(record, arguments.recover_within)
    print('%s\n%.1f minutes, seed %d, %g images a second, detector %s'
          % (describe_machine(), (record.ended_s - record.began_s) / 60, arguments.seed, arguments.rate,
             arguments.detector))
    answered = len(set(stamp_ns for _at_s, stamp_ns in record.arrivals[TRACKS_TOPIC])
                   & set(stamp_ns for stamp_ns, sent_s in record.images if sent_s >= record.began_s))
    print('%d images sent, %d answered with tracks; %d arrays of tracks came, %d of them empty'
          % (_sent(record), answered, len(record.arrivals[TRACKS_TOPIC]), empty[TRACKS_TOPIC]))
    for table in (_faults, _inputs, _processes):
        print('\n' + '\n'.join(table(record)))
    print('\ninvariants')
    for finding in findings:
        print('%-7s %-36s %s (limit: %s)' % (('BROKEN' if finding.broken else 'holds',) + finding[:3]))
        for at_s, what in finding.broken[:SHOWN]:
            print('        at %s: %s' % (_clock(record, at_s), what))
        if len(finding.broken) > SHOWN:
            print('        and %d more' % (len(finding.broken) - SHOWN))
    return findings


def _clock(record, at_s):
    return '%d:%04.1f' % divmod(max(0.0, at_s - record.began_s), 60)


def _faults(record):
    rows = ['%-36s %5s %10s %24s' % ('fault', 'times', 'lasted s', 'then recovery s: median, longest')]
    kinds = collections.OrderedDict()
    for fault in sorted(record.finished_faults, key=lambda fault: fault.name):
        took_s = np.inf if fault.recovered_s is None else fault.recovered_s - fault.ended_s
        kinds.setdefault(fault.name, []).append((fault.ended_s - fault.began_s, took_s))
    for name, times_s in kinds.items():
        lasted_s, took_s = np.array(times_s).T
        rows.append('%-36s %5d %10.1f %24.2f %7.2f' % (name, len(took_s), np.median(lasted_s), np.median(took_s),
                                                       took_s.max()))
    return rows


def _inputs(record):
    """What is sent to a node is what the one before it published, and what was thrown in."""
    totals, reasons, rows = collections.OrderedDict(), collections.Counter(), []
    for status in last_of_each(record):
        totals[status.node] = totals.get(status.node, 0) + np.array(balance_of(status))
        for reason in BALANCES[status.node].reasons:
            reasons[status.node, reason] += status.counts.get(reason, 0)
    before = 0
    for node in (node for node in BALANCES if node in totals):
        row = (node, BALANCES[node].received, before + record.sent.get(TOPICS[node], 0)) + tuple(totals[node])
        rows.append('%-22s %-14s %8d %8d %10d %8d %8d' % row)
        before = totals[node][1]
    titles = '%-22s %-14s %8s %8s %10s %8s %8s' % ('inputs of', '', 'sent', 'came', 'published', 'not', 'at work')
    return [titles] + rows + ['not published by %-22s %6d %s' % (node, count, reason)
                              for (node, reason), count in reasons.items() if count]


def _processes(record):
    titles = 'process of', 'minutes', 'MB begin', 'MB end', 'MB/min', 'risen MB', 'ms/image', 'then'
    rows = ['%-22s %9s %9s %9s %9s %9s %10s %11s' % titles]
    for (node, _pid), statuses in processes_of(record).items():
        growth, steps = growth_of(record, statuses), cpu_ms_of(record, statuses)
        times = '%10.1f %11.1f' % halves_ms(steps) if len(steps) > 1 else '%10s %11s' % ('-', '-')
        rows.append('%-22s %9.1f %9.1f %9.1f %+9.2f %9.1f %s' % (
            node, growth.seconds / 60, growth.first_mb, growth.last_mb, growth.mb_per_minute, growth.risen_mb, times))
    return rows


def as_json(record, empty, findings, arguments):
    """All figures. Times are seconds since the begin."""
    def since(at_s):
        return None if at_s is None else at_s - record.began_s
    return {
        'machine': describe_machine(), 'minutes': since(record.ended_s) / 60, 'seed': arguments.seed,
        'rate_hz': arguments.rate, 'detector': arguments.detector, 'images': _sent(record), 'sent': record.sent,
        'arrays': {topic: len(arrivals) for topic, arrivals in record.arrivals.items()}, 'empty': empty,
        'faults': [{'name': fault.name, 'began_s': since(fault.began_s), 'ended_s': since(fault.ended_s),
                    'recovered_s': since(fault.recovered_s)} for fault in record.finished_faults],
        'processes': [dict(node=status.node, pid=status.pid, counts=status.counts, memory_mb=_memory(record, status))
                      for status in last_of_each(record)],
        'latency_ms': [np.percentile(lags[:, 2], (50, 95)).tolist() if len(lags) else None
                       for lags in thirds_of(record, lags_of(record))],
        'invariants': [{'name': finding.name, 'holds': not finding.broken, 'measured': finding.measured,
                        'limit': finding.limit,
                        'broken': [{'at_s': since(at_s), 'what': what} for at_s, what in finding.broken]}
                       for finding in findings]}


def _sent(record):
    return sum(sent_s >= record.began_s for _stamp_ns, sent_s in record.images)


def _memory(record, last):
    """[[seconds, megabytes], ...] of the process of a Status."""
    return [(status.at_s - record.began_s, status.rss_mb) for status in record.statuses
            if (status.node, status.pid) == (last.node, last.pid)]
