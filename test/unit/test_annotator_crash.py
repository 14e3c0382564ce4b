"""A killed annotator loses no entered truth and no typed text."""
import multiprocessing
import os
import signal
import time

import numpy as np
import pytest

from ros_3d_bb_annotator.document import Document
from support.small_session import change_json

COUNT = 100
LONGEST_S = 0.006  # of a random wait before the kill: about one annotation


def truth_m_of(index):
    return index / 1000.0, 1 + index / 100.0


def _annotate(folder, reports):
    """Annotate new measurements, and report typed and entered ones."""
    document = Document.open(folder)
    for index, measurement in enumerate(document.measurements):
        if measurement.state == 'new':
            document.set_draft(index, {'z': str(index)})
            reports.send(('typed', index))
            document.set_truth(index, *truth_m_of(index))
            reports.send(('entered', index))


def _run_and_kill(folder, random):
    """Reports of a process until it is killed at a random time: sets of indices."""
    receiver, sender = multiprocessing.Pipe(duplex=False)
    process = multiprocessing.get_context('fork').Process(target=_annotate, args=(folder, sender))
    process.start()
    sender.close()
    reports = {'typed': set(), 'entered': set()}
    to_wait_for = random.randint(0, 8)
    try:
        for number in range(2 * COUNT):
            if number == to_wait_for:
                time.sleep(random.uniform(0, LONGEST_S))
                os.kill(process.pid, signal.SIGKILL)
            kind, index = receiver.recv()
            reports[kind].add(index)
    except EOFError:
        pass
    process.join()
    return reports


@pytest.mark.slow
def test_kill_at_any_moment_loses_at_most_what_is_being_typed(folder):
    # the measurements share their images, because only the description is tested
    change_json(folder, lambda content: content.update(
        frames=[dict(content['frames'][0], id='m%d' % number) for number in range(COUNT)]))
    random, entered, kills = np.random.RandomState(5), set(), 0
    while len(entered) < COUNT:
        reports, kills = _run_and_kill(folder, random), kills + 1
        entered |= reports['entered']
        document = Document.open(folder)
        saved = set(index for index in range(COUNT) if document.measurements[index].state == 'annotated')
        for index in saved:
            x_m, _y_m, z_m = document.measurements[index].truth_m
            assert (x_m, z_m) == pytest.approx(truth_m_of(index))
        assert entered <= saved and len(saved - entered) <= 1
        assert reports['typed'] <= saved | set(index for index in range(COUNT) if document.draft(index))
        assert all(document.draft(index).get('z', str(index)) == str(index) for index in range(COUNT))
        entered = saved
    assert kills > 2
