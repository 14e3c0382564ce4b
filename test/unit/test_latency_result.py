"""Results of the latency benchmark for records with known results."""
import numpy as np
import pytest

from ros_3d_bb_lab.evaluation.latency.benchmark import TITLES, cases_of, details, row
from ros_3d_bb_lab.evaluation.latency.latency_result import STAGES, compared_with_limits, result_of

NS = 10 ** 9
BEGAN_S = 1000.0


def record_of(latencies_ms, rate_hz=10.0, usage=None):
    """Record of images at a rate from the start of the window; those with the latency None have no answer."""
    sent_ns = [int((BEGAN_S + number / rate_hz) * NS) for number in range(len(latencies_ms))]
    markers = [(stamp_ns, stamp_ns / NS + latency_ms / 1e3)
               for stamp_ns, latency_ms in zip(sent_ns, latencies_ms) if latency_ms is not None]
    arrivals = {stage: markers if stage == 'markers' else [] for stage in STAGES}
    return {'began_s': BEGAN_S, 'ended_s': BEGAN_S + len(latencies_ms) / rate_hz, 'sent_ns': sent_ns,
            'arrivals': arrivals, 'usage': usage or {}}


def test_a_result_has_rates_latencies_and_usage():
    usage = {'bbox3d_node': [(BEGAN_S, 5.0, 100.0), (BEGAN_S + 10, 6.5, 101.0)]}
    result = result_of(record_of([20.0] * 100, usage=usage))
    assert {'input_hz', 'output_hz', 'p50_ms', 'p95_ms', 'p99_ms', 'dropped', 'cpu_percent', 'rss_mb'} <= set(result)
    assert set(result['stages_ms']) == set(STAGES)
    assert result['cpu_percent'] == {'bbox3d_node': pytest.approx(15.0)}
    assert result['rss_mb'] == {'bbox3d_node': 101.0}
    assert result['trend']['rss_mb_per_minute'] == {'bbox3d_node': pytest.approx(6.0)}
    assert 'free' in row(dict(result, name='free', load_average=0.0))


def test_the_usage_of_a_node_is_a_multiple_of_that_of_its_limit():
    cpu_percent = {'tracker_node': 15.0, 'tracker_node_limit': 3.0, 'tracker_node_subscribing': 2.0, 'rosout': 0.1}
    assert compared_with_limits(cpu_percent) == {'tracker_node': {
        'cpu_percent': 15.0, 'limit_percent': 3.0, 'subscribing_percent': 2.0, 'times_limit': 5.0}}
    usage = {node: [(BEGAN_S, 0.0, 50.0), (BEGAN_S + 10, percent / 10, 50.0)] for node, percent in cpu_percent.items()}
    result = dict(result_of(record_of([20.0] * 100, usage=usage)), name='free', load_average=0.0)
    assert result['nodes']['tracker_node']['times_limit'] == pytest.approx(5.0)
    assert row(result).split()[TITLES.index('CPU %')] == '15.0'  # the limits do not belong to the pipeline
    assert '5.00 times its limit' in details(result)


def test_a_growing_queue_increases_the_latency_of_the_last_minute():
    trend = result_of(record_of(list(np.linspace(10, 310, 1800))))['trend']
    assert trend['edge_s'] == 60.0
    assert trend['first']['p50_ms'] == pytest.approx(60, abs=1) and trend['last']['p50_ms'] == pytest.approx(260, abs=1)


def test_each_model_file_is_a_case_with_and_without_load():
    assert [case.name for case in cases_of([]) if not case.loaded] == ['free', 'depth']
    cases = {case.name: case for case in cases_of(['/a/yolov5n.pt', '/b/yolox_nano.onnx'])}
    assert set(cases) == {name + load for load in ('', '+load')
                          for name in ('free', 'depth', 'yolov5-512', 'yolov5-640', 'yolov5-auto', 'yolox_nano')}
    assert cases['yolov5-512'].weights == '/a/yolov5n.pt' and cases['yolox_nano+load'].weights == '/b/yolox_nano.onnx'
