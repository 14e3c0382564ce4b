"""From what latency_probe_node recorded to the figures of one case."""
import numpy as np

STAGES = ('boxes_2d', 'boxes_3d', 'tracks', 'markers')  # in the order in which an image passes them
EDGE_S = 60.0  # the beginning and the end of a long run that are compared


def result_of(record):
    """The figures of a case.

    Parameters
    ----------
    record : dict
        `began_s`, `ended_s`: the window; `sent_ns`: stamps of the images; `arrivals`: by stage, [stamp in ns, arrival
        in seconds]; `usage`: by node, [time in s, CPU time in s, memory in MB]. One clock for all. Images of which the
        stamp is in the window count.

    Returns
    -------
    dict
        As in design §8: rates in Hz, latencies from stamp to arrival of the markers in ms, CPU in percent of a core,
        memory at the end in MB. `stages_ms`: by stage, the median latency. `trend`: `first` and `last` minute (or half
        of the window, where that is shorter), and by node how fast memory grew, MB in a minute, in the second half: in
        the first minute caches fill.
    """
    began_s, ended_s = record['began_s'], record['ended_s']
    window_s = ended_s - began_s
    sent_ns = [stamp_ns for stamp_ns in record['sent_ns'] if began_s <= stamp_ns * 1e-9 < ended_s]
    stages = {stage: latencies(sent_ns, record['arrivals'][stage]) for stage in STAGES}
    answered = stages[STAGES[-1]]
    result = {'input_hz': len(sent_ns) / window_s, 'output_hz': len(answered) / window_s,
              'dropped': len(sent_ns) - len(answered)}
    result.update(percentiles(answered[:, 1]))
    result['stages_ms'] = {stage: percentiles(found[:, 1])['p50_ms'] for stage, found in stages.items()}
    result.update(_usage(record['usage']))
    edge_s = min(EDGE_S, window_s / 2)
    first, last = answered[:, 0] < began_s + edge_s, answered[:, 0] >= ended_s - edge_s
    result['trend'].update(edge_s=edge_s, first=percentiles(answered[first, 1]), last=percentiles(answered[last, 1]))
    return result


def latencies(sent_ns, arrivals):
    """When images were taken and how long their answers took.

    Parameters
    ----------
    sent_ns : list of int
    arrivals : list of (int, float)
        Stamp in ns and arrival in seconds; the first of several with one stamp counts.

    Returns
    -------
    numpy.ndarray, (n, 2)
        Stamp in seconds and latency in ms of the images that were answered.
    """
    arrived_s = {}
    for stamp_ns, arrival_s in arrivals:
        arrived_s.setdefault(stamp_ns, arrival_s)
    return np.array([(stamp_ns * 1e-9, (arrived_s[stamp_ns] - stamp_ns * 1e-9) * 1e3)
                     for stamp_ns in sent_ns if stamp_ns in arrived_s]).reshape(-1, 2)


def percentiles(values_ms):
    """p50_ms, p95_ms and p99_ms of latencies; None of none."""
    if not len(values_ms):
        return {'p50_ms': None, 'p95_ms': None, 'p99_ms': None}
    return {'p%d_ms' % share: float(np.percentile(values_ms, share)) for share in (50, 95, 99)}


def _usage(usage):
    """CPU and memory by node, and how fast that grows."""
    samples = {node: np.array(rows) for node, rows in usage.items() if len(rows) > 1}
    return {'cpu_percent': {node: float(100 * (rows[-1, 1] - rows[0, 1]) / (rows[-1, 0] - rows[0, 0]))
                            for node, rows in samples.items()},
            'rss_mb': {node: float(rows[-1, 2]) for node, rows in samples.items()},
            'trend': {'rss_mb_per_minute': {node: _growth(rows[len(rows) // 2 - 1:])
                                            for node, rows in samples.items()}}}


def _growth(rows):
    """The slope of memory, MB in a minute; `rows` as in a record, at least two."""
    return float(np.polyfit(rows[:, 0] - rows[0, 0], rows[:, 2], 1)[0] * 60)
