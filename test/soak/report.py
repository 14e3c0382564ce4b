"""How a soak fared, as tables and as JSON."""
import collections

import numpy as np

from ros_3d_bb.evaluation.machine import describe_machine
from ros_3d_bb.messages import TRACKS_TOPIC
from soak.invariants import (balance_of, cpu_ms_of, findings_of, growth_of, halves_ms, lags_of, last_of_each,
                             processes_of, thirds_of)

SHOWN = 5  # of the places where an invariant was broken


def print_report(record, empty, arguments):
    """Print the tables. Returns the findings."""
    findings = findings_of(record, arguments.recover_within)
    print('%s\n%.1f minutes, seed %d, %g images a second, detector %s'
          % (describe_machine(), (record.ended_s - record.began_s) / 60, arguments.seed, arguments.rate,
             arguments.detector))
    answered = len(set(stamp_ns for _at_s, stamp_ns in record.arrivals[TRACKS_TOPIC])
                   & set(stamp_ns for stamp_ns, _sent_s in record.images))
    print('%d images sent, %d answered with tracks; %d arrays of tracks came, %d of them empty'
          % (len(record.images), answered, len(record.arrivals[TRACKS_TOPIC]), empty[TRACKS_TOPIC]))
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
    rows = ['%-36s %5s %12s %12s' % ('fault', 'times', 'median s', 'longest s')]
    kinds = collections.OrderedDict()
    for fault in sorted(record.faults, key=lambda fault: fault.name):
        kinds.setdefault(fault.name, []).append(
            np.inf if fault.recovered_s is None else fault.recovered_s - fault.ended_s)
    row = '%-36s %5d %12.2f %12.2f'
    return rows + [row % (name, len(took_s), np.median(took_s), max(took_s)) for name, took_s in kinds.items()]


def _inputs(record):
    rows = ['%-22s %9s %9s %9s %9s' % ('inputs of', 'came', 'published', 'reasons', 'at work')]
    totals = collections.OrderedDict()
    for status in sorted(last_of_each(record), key=lambda status: status.node):
        totals[status.node] = totals.get(status.node, 0) + np.array(balance_of(status))
    return rows + ['%-22s %9d %9d %9d %9d' % ((node,) + tuple(total)) for node, total in totals.items()]


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
    first, last = thirds_of(record, lags_of(record))
    return {
        'machine': describe_machine(), 'minutes': (record.ended_s - record.began_s) / 60, 'seed': arguments.seed,
        'rate_hz': arguments.rate, 'detector': arguments.detector, 'images': len(record.images),
        'arrays': {topic: len(arrivals) for topic, arrivals in record.arrivals.items()}, 'empty': empty,
        'faults': [{'name': fault.name, 'began_s': since(fault.began_s), 'ended_s': since(fault.ended_s),
                    'recovered_s': since(fault.recovered_s)} for fault in record.faults],
        'processes': [dict(node=node, pid=pid, **growth_of(record, statuses)._asdict())
                      for (node, pid), statuses in processes_of(record).items()],
        'memory_mb': {'%s %d' % key: [(since(status.at_s), status.rss_mb) for status in record.statuses
                                      if (status.node, status.pid) == key]
                      for key in set((status.node, status.pid) for status in record.statuses)},
        'counts': [{'node': status.node, 'pid': status.pid, 'at_s': since(status.at_s), 'counts': status.counts}
                   for status in last_of_each(record)],
        'latency_ms': {name: np.percentile(lags[:, 2], (50, 95)).tolist() if len(lags) else None
                       for name, lags in (('first', first), ('last', last))},
        'invariants': [{'name': finding.name, 'holds': not finding.broken, 'measured': finding.measured,
                        'limit': finding.limit,
                        'broken': [{'at_s': since(at_s), 'what': what} for at_s, what in finding.broken]}
                       for finding in findings]}
