"""Report of a soak as tables and as JSON."""
import collections

import numpy as np

from ros_3d_bb.conversions.perception_msgs import TRACKS_TOPIC
from ros_3d_bb_lab.evaluation.defaults import describe_machine
from soak.invariants import findings_of, last_of_each

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
    print('\n' + '\n'.join(_faults(record)))

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
