"""Results of one case of the latency benchmark, computed from the record of latency_probe_node."""
import numpy as np

STAGES = 'boxes_2d', 'boxes_3d', 'tracks', 'markers'  # in processing order


def result_of(record):
    """Compute the results of a case.

    A record has the start and the end of the measurement, the stamps of the images, `arrivals` by stage [stamp in ns,
    arrival in seconds], and `usage` by node [time in s, CPU time in s, memory in MB]. All times are from the same
    clock. Only images with a stamp during the measurement are evaluated.

    Latencies of the result are from the stamp to the arrival of the markers, CPU usage is in percent of a core, memory
    is that at the end. `stages_ms`: median latency by stage.
    """
    began_s, ended_s = record['began_s'], record['ended_s']
    window_s = ended_s - began_s
    sent_ns = [stamp_ns for stamp_ns in record['sent_ns'] if began_s <= stamp_ns * 1e-9 < ended_s]
    stages = {stage: latencies(sent_ns, record['arrivals'][stage]) for stage in STAGES}
    answered = stages[STAGES[-1]]
    result = {'input_hz': len(sent_ns) / window_s, 'output_hz': len(answered) / window_s,
              'dropped': len(sent_ns) - len(answered)}
    result.update(percentiles(answered))
    result['stages_ms'] = {stage: percentiles(found)['p50_ms'] for stage, found in stages.items()}
    samples = {node: np.array(rows) for node, rows in record['usage'].items() if len(rows) > 1}
    result['cpu_percent'] = {node: float(100 * (rows[-1, 1] - rows[0, 1]) / (rows[-1, 0] - rows[0, 0]))
                             for node, rows in samples.items()}
    result['rss_mb'] = {node: float(rows[-1, 2]) for node, rows in samples.items()}
    return result


def latencies(sent_ns, arrivals):
    """Latencies (n,) in ms of the images with an arrival; the first arrival counts."""
    arrived_s = {}
    for stamp_ns, arrival_s in arrivals:
        arrived_s.setdefault(stamp_ns, arrival_s)
    return np.array([(arrived_s[stamp_ns] - stamp_ns * 1e-9) * 1e3 for stamp_ns in sent_ns if stamp_ns in arrived_s])


def percentiles(values_ms):
    """p50_ms, p95_ms and p99_ms of latencies; None if there are no latencies."""
    if not len(values_ms):
        return {'p50_ms': None, 'p95_ms': None, 'p99_ms': None}
    return {'p%d_ms' % share: float(np.percentile(values_ms, share)) for share in (50, 95, 99)}
