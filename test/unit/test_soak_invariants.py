"""Each invariant of the soak holds for the record of a working graph, and is violated by one of a faulty graph."""
import functools

import pytest

from soak.invariants import (HELD_MB, LAG_IMAGES, RISE_MB, WAITING, WAITING_AT_END, cpu_is_flat,
                             every_input_has_an_outcome, findings_of, graph_recovers, ids_are_not_reused,
                             memory_is_flat, no_message_crashes_a_node, outcomes_are_known, queues_do_not_grow,
                             stamps_are_those_of_images, stamps_do_not_decrease, tracks_do_not_outlive_max_age)
from soak.records import INTERRUPTED, Fault, Record, Status, Track

NS = 10 ** 9
BEGAN_S, SECONDS = 1000.0, 300
STAMPED_NS = 77 * NS  # stamp of the first image
PID, KILLED_PID = 42, 7
FAULT = Fault('tf stops', BEGAN_S + 100.0, BEGAN_S + 105.0, BEGAN_S + 105.5, False)
DISORDER = FAULT._replace(disorders=True)
HANGS = FAULT._replace(name='tracker_node hangs')
WARM_UP_S = 45  # 15 % of five minutes


def stamp_at(second):
    return STAMPED_NS + int(round(second * NS))


def record_of(**changed):
    """Record of five minutes: one image per second is answered after 0.1 s; one fault, and one killed process."""
    tracks = [tracks_at(second, Track(3, STAMPED_NS, stamp_at(second))) for second in range(SECONDS)]
    record = Record(
        began_s=BEGAN_S, ended_s=BEGAN_S + SECONDS,
        images=[(stamp_at(second), BEGAN_S + second) for second in range(SECONDS)], wrong_ns={5}, sent={},
        arrivals={'ros_3d_bb/tracks': [arrival[:2] for arrival in tracks]}, empty={}, tracks=tracks,
        statuses=statuses(), faults=[FAULT], deaths=[(BEGAN_S + 50.0, KILLED_PID, 'bbox3d_node ended')],
        killed={KILLED_PID}, errors=[])
    return record._replace(**changed)


def tracks_at(second, *tracks, delay_s=0.1):
    return BEGAN_S + second + delay_s, stamp_at(second), list(tracks)


def statuses(rss_mb=lambda second: 100.0, cpu_s=lambda second: 0.004 * second, **lost):
    """One status of a tracker per second; `lost` are inputs without an outcome by second (`at_30=4`)."""
    return [Status(BEGAN_S + second, 'tracker_node', PID,
                   {'3D boxes received': second + lost.get('at_%d' % second, 0),
                    'images tracked': second - second // 10, 'no transform': second // 10},
                   cpu_s(second), rss_mb(second)) for second in range(SECONDS)]


def arrivals_back(at_second):
    """Arrivals of which one has the stamp of 2 s before."""
    return {'ros_3d_bb/bb_3d': [(BEGAN_S + second + 0.1, stamp_at(second - 2 * (second == at_second)))
                                for second in range(SECONDS)]}


def arrivals(*seconds_and_stamps):
    return {'visualization_marker_array': [(BEGAN_S + second, stamp_ns) for second, stamp_ns in seconds_and_stamps]}


def tracks_with(second, track):
    """Tracks of the working graph except for one second."""
    tracks = record_of().tracks
    return tracks[:second] + [tracks_at(second, track)] + tracks[second + 1:]


def tracks_late_by(delay_s):
    return [tracks_at(second, delay_s=delay_s(second)) for second in range(SECONDS)]


def steps_mb(first_mb, second_mb):
    """Memory that rises after 101 s and after 201 s."""
    return lambda second: 100 + (second > 101) * first_mb + (second > 201) * second_mb


def later(fault):
    """The same fault 100 s later."""
    return fault._replace(**{name: getattr(fault, name) + 100 for name in ('began_s', 'ended_s', 'recovered_s')})


def test_all_invariants_hold_for_a_working_graph():
    findings = findings_of(record_of(), 2.0)
    assert len(set(finding.name for finding in findings)) == len(findings) == 10
    assert [finding for finding in findings if finding.broken] == []
    assert all(finding.measured and finding.limit for finding in findings)


at_end = 'at_%d' % (SECONDS - 1)
recovers = functools.partial(graph_recovers, within_s=2.0)


@pytest.mark.parametrize('check, broken_s, changed', [
    (every_input_has_an_outcome, [SECONDS - 1], {'statuses': statuses(**{at_end: WAITING_AT_END + 1})}),
    (every_input_has_an_outcome, [], {'statuses': statuses(at_100=WAITING, **{at_end: WAITING_AT_END})}),
    (every_input_has_an_outcome, [], {'statuses': statuses(**{at_end: WAITING_AT_END + 1}), 'killed': {PID}}),
    (every_input_has_an_outcome, [30], {'statuses': statuses(at_30=-1)}),
    (every_input_has_an_outcome, [30], {'statuses': statuses(at_30=WAITING + 1)}),
    (stamps_do_not_decrease, [60.1], {'arrivals': arrivals_back(60)}),
    (stamps_do_not_decrease, [102.1], {'arrivals': arrivals_back(102)}),
    (stamps_do_not_decrease, [], {'arrivals': arrivals_back(102), 'faults': [DISORDER]}),
    (stamps_do_not_decrease, [110.1], {'arrivals': arrivals_back(110), 'faults': [DISORDER]}),
    (stamps_do_not_decrease, [], {'arrivals': arrivals_back(110), 'faults': [
        DISORDER._replace(name=INTERRUPTED, recovered_s=None)]}),
    # markers have no stamp while there are no people, so the first one after a jump may arrive late
    (stamps_do_not_decrease, [151], {'faults': [DISORDER], 'arrivals': arrivals(
        (90, stamp_at(90)), (150, stamp_at(80)), (151, stamp_at(79)))}),
    (stamps_do_not_decrease, [], {'arrivals': arrivals((0, STAMPED_NS), (1, STAMPED_NS))}),
    (stamps_are_those_of_images, [1], {'arrivals': arrivals((0, 5), (1, STAMPED_NS + 1))}),
    # in this second, and where the first track with this ID returns
    (ids_are_not_reused, [40.1, 41.1], {'tracks': tracks_with(40, Track(3, stamp_at(40), stamp_at(40)))}),
    (ids_are_not_reused, [], {'tracks': tracks_with(40, Track(4, stamp_at(40), stamp_at(40)))}),
    (tracks_do_not_outlive_max_age, [40.1], {'tracks': tracks_with(40, Track(9, stamp_at(30), stamp_at(35)))}),
    (tracks_do_not_outlive_max_age, [40.1], {'tracks': tracks_with(40, Track(9, stamp_at(0), stamp_at(41)))}),
    (tracks_do_not_outlive_max_age, [40.1], {'tracks': tracks_with(40, Track(9, stamp_at(41), stamp_at(40)))}),
    (tracks_do_not_outlive_max_age, [], {'tracks': tracks_with(40, Track(9, stamp_at(0), stamp_at(36.5)))}),
    (no_message_crashes_a_node, [50], {'killed': set()}),
    (no_message_crashes_a_node, [9], {'errors': [(BEGAN_S + 9, 'bad callback')]}),
    (no_message_crashes_a_node, [20], {'statuses': [
        Status(BEGAN_S + 20, 'tracker_node', PID, {'detections failed': 1}, 0.0, 0.0)]}),
    (recovers, [105], {'faults': [FAULT._replace(recovered_s=None)]}),
    (recovers, [105], {'faults': [FAULT._replace(recovered_s=BEGAN_S + 107.1)]}),
    (recovers, [], {'faults': [FAULT._replace(name=INTERRUPTED, recovered_s=None)]}),
    (queues_do_not_grow, [SECONDS], {'tracks': tracks_late_by(lambda second: second / 30.0)}),
    (queues_do_not_grow, [], {'tracks': tracks_late_by(lambda _second: 20)}),
    (queues_do_not_grow, [], {'tracks': tracks_late_by(lambda second: (LAG_IMAGES - 1) * (second > 150))}),
    (queues_do_not_grow, [SECONDS], {'tracks': []}),
    (queues_do_not_grow, [], {'tracks': [], 'ended_s': BEGAN_S + 59.0}),  # interrupted early
    (memory_is_flat, [SECONDS], {'faults': [], 'statuses': statuses(
        rss_mb=lambda second: 100 + 1.1 * RISE_MB * second / (SECONDS - 1 - WARM_UP_S))}),
    (memory_is_flat, [], {'statuses': statuses(rss_mb=lambda second: 100 + min(second, WARM_UP_S))}),
    (memory_is_flat, [], {'statuses': statuses(rss_mb=lambda second: 5 * second)[:60]}),  # too few samples
    (memory_is_flat, [], {'statuses': statuses(rss_mb=lambda second: 130 - 30 * (second // 10 % 2))}),
    # the first fault of a kind may take memory
    (memory_is_flat, [SECONDS], {'faults': [FAULT, later(FAULT)], 'statuses': statuses(steps_mb(50, RISE_MB + 1))}),
    (memory_is_flat, [], {'faults': [FAULT, later(FAULT)._replace(name='camera pauses')],
                          'statuses': statuses(steps_mb(50, RISE_MB + 1))}),
    (memory_is_flat, [], {'faults': [HANGS, later(HANGS)], 'statuses': statuses(steps_mb(10, HELD_MB - 11))}),
    (memory_is_flat, [SECONDS], {'faults': [HANGS, later(HANGS)], 'statuses': statuses(steps_mb(10, HELD_MB - 9))}),
    (cpu_is_flat, [SECONDS], {'statuses': statuses(
        cpu_s=lambda second: 0.02 * (second + 3 * max(0, second - SECONDS // 2)))}),
    (cpu_is_flat, [], {'statuses': statuses(
        cpu_s=lambda second: 0.02 * (second + 0.5 * max(0, second - SECONDS // 2)))})])
def test_violations_are_found_at_their_time(check, broken_s, changed):
    assert [at_s - BEGAN_S for at_s, _text in check(record_of(**changed)).broken] == pytest.approx(broken_s)


def test_outcomes_are_known_when_the_newest_counters_of_each_node_are_balanced():
    behind = statuses(at_9=WAITING_AT_END + 1)
    assert outcomes_are_known(behind[9:11]) and not outcomes_are_known(behind[8:10])
