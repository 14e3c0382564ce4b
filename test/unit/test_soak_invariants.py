"""Each invariant of the soak holds for a record of a graph that works, and breaks for one of a graph that does not."""
import pytest

from soak.invariants import (CPU_MORE_MS, HELD_MB, LAG_IMAGES, RISE_MB, WAITING, WAITING_AT_END, cpu_is_flat,
                             every_input_has_an_outcome, findings_of, growth_of, it_recovers, memory_is_flat,
                             nobody_dies_of_a_message, nobody_outlasts_memory, numbers_are_not_reused,
                             outcomes_are_known, processes_of, queues_do_not_grow, stamps_are_those_of_images,
                             stamps_do_not_go_back)
from soak.records import INTERRUPTED, Death, FaultDone, Record, Status, Track

NS = 10 ** 9
BEGAN_S, SECONDS = 1000.0, 300
STAMPED_NS = 77 * NS  # the stamp of what is sent at the beginning
PID = 42


def stamp_at(at_s):
    return STAMPED_NS + int(round((at_s - BEGAN_S) * NS))


def sound(**changed):
    """The record of five minutes with one image a second, each answered in 0.1 s, one fault and one killed process."""
    times_s = [BEGAN_S + second for second in range(SECONDS)]
    tracks = [(at_s + 0.1, stamp_at(at_s), [Track(3, STAMPED_NS, stamp_at(at_s))]) for at_s in times_s]
    record = Record(
        began_s=BEGAN_S, ended_s=BEGAN_S + SECONDS, images=[(stamp_at(at_s), at_s) for at_s in times_s],
        wrong_ns={5}, sent={}, arrivals={'ros_3d_bb/tracks': [arrival[:2] for arrival in tracks]}, tracks=tracks,
        statuses=[status(second) for second in range(SECONDS)],
        faults=[FaultDone('tf stops', BEGAN_S + 100.0, BEGAN_S + 105.0, BEGAN_S + 105.5, False)],
        deaths=[Death(BEGAN_S + 50.0, 'bbox3d_node', 7, 'died with exit code -9')], killed={7}, errors=[])
    return record._replace(**changed)


def status(second, node='tracker_node', cpu_s=None, rss_mb=100.0, **counts):
    """What a tracker says after so many seconds, with an image each."""
    counts = dict({'3D boxes received': second, 'images tracked': second - second // 10,
                   'no transform': second // 10}, **counts)
    return Status(BEGAN_S + second, node, PID, counts, 0.004 * second if cpu_s is None else cpu_s, rss_mb)


def statuses_with(**functions):
    """A Status a second, of which fields are functions of the second."""
    return [status(second, **{name: made(second) for name, made in functions.items()}) for second in range(SECONDS)]


def test_all_invariants_hold_for_a_graph_that_works():
    findings = findings_of(sound(), 2.0)
    assert len(set(finding.name for finding in findings)) == len(findings) == 10
    assert [finding for finding in findings if finding.broken] == []
    assert all(finding.measured and finding.limit for finding in findings)


def broken_of(check, **changed):
    """Seconds after the beginning, and texts, where an invariant is broken."""
    return [(at_s - BEGAN_S, text) for at_s, text in check(sound(**changed)).broken]


def test_an_input_that_was_counted_in_and_never_out_is_found_at_the_end():
    lost = statuses_with()
    lost[-1].counts['3D boxes received'] += WAITING_AT_END + 1
    (at_s, text), = broken_of(every_input_has_an_outcome, statuses=lost)
    assert at_s == SECONDS - 1 and text == 'tracker_node: 4 inputs have no outcome at the end'


def test_inputs_that_are_at_work_are_no_fault():
    waiting = statuses_with()
    waiting[100].counts['3D boxes received'] += WAITING
    waiting[-1].counts['3D boxes received'] += WAITING_AT_END
    assert broken_of(every_input_has_an_outcome, statuses=waiting) == []


def test_a_killed_node_may_have_had_inputs_at_work():
    lost = statuses_with()
    lost[-1].counts['3D boxes received'] += WAITING_AT_END + 1
    assert broken_of(every_input_has_an_outcome, statuses=lost, killed={PID}) == []


@pytest.mark.parametrize('more', [-1, WAITING + 1])
def test_outcomes_without_an_input_and_inputs_that_pile_up_are_found_at_once(more):
    wrong = statuses_with()
    wrong[30].counts['3D boxes received'] += more
    (at_s, text), = broken_of(every_input_has_an_outcome, statuses=wrong)
    assert at_s == 30 and '%d have no outcome' % more in text


def arrivals_back(second):
    """Of which that of a second has the stamp of 2 s before."""
    times_s = [BEGAN_S + number - (2 if number == second else 0) for number in range(SECONDS)]
    return {'ros_3d_bb/bb_3d': [(BEGAN_S + number + 0.1, stamp_at(at_s)) for number, at_s in enumerate(times_s)]}


def test_a_stamp_older_than_its_predecessor_is_found():
    (at_s, text), = broken_of(stamps_do_not_go_back, arrivals=arrivals_back(60))
    assert at_s == pytest.approx(60.1) and 'ros_3d_bb/bb_3d' in text


def test_a_fault_that_lasts_excuses_no_older_stamp_unless_it_makes_time_go_back():
    fault, = sound().faults
    assert len(broken_of(stamps_do_not_go_back, arrivals=arrivals_back(102))) == 1
    assert broken_of(stamps_do_not_go_back, arrivals=arrivals_back(102), faults=[fault._replace(disturbs=True)]) == []
    assert len(broken_of(stamps_do_not_go_back, arrivals=arrivals_back(110),
                         faults=[fault._replace(disturbs=True)])) == 1


def test_after_a_jump_the_first_message_may_come_late():
    """Markers carry no stamp while there is nobody."""
    jump = sound().faults[0]._replace(disturbs=True)
    sparse = {'visualization_marker_array': [(BEGAN_S + 90, stamp_at(BEGAN_S + 90)),
                                             (BEGAN_S + 150, stamp_at(BEGAN_S + 80)),
                                             (BEGAN_S + 151, stamp_at(BEGAN_S + 79))]}
    (at_s, _text), = broken_of(stamps_do_not_go_back, arrivals=sparse, faults=[jump])
    assert at_s == 151


def test_equal_stamps_are_in_order():
    twice = [(BEGAN_S, STAMPED_NS), (BEGAN_S + 0.1, STAMPED_NS)]
    assert broken_of(stamps_do_not_go_back, arrivals={'ros_3d_bb/tracks': twice}) == []


def test_a_stamp_that_nobody_sent_is_found_and_that_of_a_wrong_message_is_none():
    arrivals = {'ros_3d_bb/tracks': [(BEGAN_S, 5), (BEGAN_S + 1, STAMPED_NS + 1)]}
    (at_s, text), = broken_of(stamps_are_those_of_images, arrivals=arrivals)
    assert at_s == 1 and '77.000000001' in text


def tracks_with(second, *tracks):
    """The tracks of `sound`, with those of one second replaced."""
    found = sound().tracks
    found[second] = found[second][:2] + (list(tracks),)
    return found


def test_a_number_that_is_given_a_second_time_is_found():
    again = Track(3, stamp_at(BEGAN_S + 40), stamp_at(BEGAN_S + 40))
    broken = broken_of(numbers_are_not_reused, tracks=tracks_with(40, again))
    assert [at_s for at_s, _text in broken] == pytest.approx([40.1, 41.1])  # there, and where the first one comes back
    assert broken_of(numbers_are_not_reused, tracks=tracks_with(40, again._replace(id=4))) == []


@pytest.mark.parametrize('first, last', [(30, 35.0), (0, 41.0), (41, 40.0)])
def test_who_was_seen_last_too_long_ago_or_in_the_future_is_found(first, last):
    wrong = Track(9, stamp_at(BEGAN_S + first), stamp_at(BEGAN_S + last))
    (at_s, text), = broken_of(nobody_outlasts_memory, tracks=tracks_with(40, wrong))
    assert at_s == pytest.approx(40.1) and 'track 9' in text


def test_somebody_who_is_hidden_is_remembered():
    hidden = Track(9, STAMPED_NS, stamp_at(BEGAN_S + 36.5))
    assert broken_of(nobody_outlasts_memory, tracks=tracks_with(40, hidden)) == []


@pytest.mark.parametrize('changed, at_s', [
    ({'killed': set()}, 50), ({'errors': [(BEGAN_S + 9, 'bad callback: ...')]}, 9),
    ({'statuses': [status(20, **{'detections failed': 1})]}, 20)])
def test_deaths_and_exceptions_are_found(changed, at_s):
    (found_s, _text), = broken_of(nobody_dies_of_a_message, **changed)
    assert found_s == at_s


@pytest.mark.parametrize('recovered_s', [None, BEGAN_S + 107.1])
def test_a_recovery_that_takes_long_or_never_comes_is_found(recovered_s):
    fault = sound().faults[0]._replace(recovered_s=recovered_s)
    (at_s, text), = broken_of(it_recovers(2.0), faults=[fault])
    assert at_s == 105 and text == 'tf stops: %s' % ('never' if recovered_s is None else '2.10 s')
    assert broken_of(it_recovers(3.0), faults=[fault._replace(recovered_s=BEGAN_S + 107.1)]) == []


def test_an_interrupted_fault_need_not_recover_and_excuses_what_it_did():
    fault = sound().faults[0]._replace(name=INTERRUPTED, recovered_s=None, disturbs=True)
    assert broken_of(it_recovers(2.0), faults=[fault]) == []
    assert broken_of(stamps_do_not_go_back, arrivals=arrivals_back(110), faults=[fault]) == []


def test_outcomes_are_known_once_the_newest_counts_of_each_node_say_so():
    behind = status(9, **{'3D boxes received': 9 + WAITING_AT_END + 1})
    assert outcomes_are_known([behind, status(10)]) and not outcomes_are_known([status(8), behind])


def test_a_queue_that_grows_is_found():
    def with_lag(images_of):
        return [(at_s + images_of(at_s - BEGAN_S), stamp_ns, found) for at_s, stamp_ns, found in sound().tracks]
    (_at_s, text), = broken_of(queues_do_not_grow, tracks=with_lag(lambda second: second / 30))
    assert 'images behind in the last third' in text
    assert broken_of(queues_do_not_grow, tracks=with_lag(lambda _second: 20)) == []  # slow is another matter
    assert broken_of(queues_do_not_grow, tracks=with_lag(lambda second: LAG_IMAGES - 1 if second > 150 else 0)) == []


def test_without_answers_nothing_is_known_of_queues():
    assert len(broken_of(queues_do_not_grow, tracks=[])) == 1
    assert broken_of(queues_do_not_grow, tracks=[], ended_s=BEGAN_S + 59.0) == []  # ended by Ctrl-C, perhaps


def test_memory_that_grows_is_found_and_that_of_the_warm_up_is_none():
    begin_s = 45.0  # 15 % of five minutes
    slope = 1.1 * RISE_MB / (SECONDS - 1 - begin_s)
    (_at_s, text), = broken_of(memory_is_flat, faults=[],
                               statuses=statuses_with(rss_mb=lambda second: 100 + slope * second))
    assert text == 'tracker_node (process 42): +22.0 MB in 254 s, +22.0 MB of them without a reason'
    assert broken_of(memory_is_flat, statuses=statuses_with(rss_mb=lambda second: 100 + min(second, begin_s))) == []


def test_a_fault_may_take_memory_when_it_first_comes_but_not_again():
    once, = sound().faults
    again = once._replace(began_s=BEGAN_S + 200, ended_s=BEGAN_S + 205, recovered_s=BEGAN_S + 206)

    def risen(second):
        return 100 + (second > 101) * 50.0 + (second > 201) * 21.0
    (_at_s, text), = broken_of(memory_is_flat, faults=[once, again], statuses=statuses_with(rss_mb=risen))
    assert text.endswith('+71.0 MB in 254 s, +21.0 MB of them without a reason')
    other = again._replace(name='camera pauses')
    assert broken_of(memory_is_flat, faults=[once, other], statuses=statuses_with(rss_mb=risen)) == []


@pytest.mark.parametrize('taken_mb, is_broken', [(HELD_MB - 1, False), (HELD_MB + 1, True)])
def test_what_a_process_takes_after_it_hung_is_bounded(taken_mb, is_broken):
    hung = [FaultDone('tracker_node hangs', BEGAN_S + begin_s, BEGAN_S + begin_s + 5, BEGAN_S + begin_s + 6, False)
            for begin_s in (100, 200)]
    statuses = statuses_with(rss_mb=lambda second: 100 + (second > 101) * 10 + (second > 201) * (taken_mb - 10))
    assert len(broken_of(memory_is_flat, faults=hung, statuses=statuses)) == is_broken
    others = [fault._replace(name='bbox3d_node hangs') for fault in hung]
    assert len(broken_of(memory_is_flat, faults=others, statuses=statuses)) == 1


def test_memory_that_is_given_back_and_taken_again_has_not_risen():
    statuses = statuses_with(rss_mb=lambda second: 100 + 30.0 * (second // 10 % 2))
    assert broken_of(memory_is_flat, statuses=statuses, faults=[])[0][1].endswith('+30.0 MB of them without a reason')
    assert growth_of(sound(faults=[]), statuses[50:]).risen_mb == 0


def test_what_is_said_of_memory_is_that_of_its_line():
    growth = growth_of(sound(), statuses_with(rss_mb=lambda second: 100 + second / 60.0)[60:])
    assert growth[:3] == pytest.approx((SECONDS - 61, 101.0, 100 + (SECONDS - 1) / 60.0))
    assert growth.mb_per_minute == pytest.approx(1.0)


def test_images_that_cost_more_and_more_are_found():
    def taken_s(second, factor):
        return 0.02 * (second + (factor - 1) * max(0, second - SECONDS // 2))
    (_at_s, text), = broken_of(cpu_is_flat, statuses=statuses_with(cpu_s=lambda second: taken_s(second, 4)))
    assert text.startswith('tracker_node (process 42): ') and text.endswith(' ms an image, then 80.0 ms')
    assert broken_of(cpu_is_flat, statuses=statuses_with(cpu_s=lambda second: taken_s(second, 1.5))) == []
    assert CPU_MORE_MS < 20


def test_a_process_that_lived_too_short_says_nothing():
    assert processes_of(sound(statuses=statuses_with()[:60])) == {}
