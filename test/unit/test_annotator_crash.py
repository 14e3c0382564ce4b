"""Whenever the annotator is killed, all that it had entered is in the session, and what was typed comes back."""
import multiprocessing
import os
import signal
import time

import numpy as np

from ros_3d_bb_annotator.document import Document
from support.small_session import change_json, write_small_session

COUNT = 100
LONGEST_S = 0.006  # of a random wait before the kill: about one annotation


def truth_of(index):
    return 0.001 * index, 1.0 + 0.01 * index


def _annotate(folder, reports):
    """Annotate what is not annotated yet; reports what is typed, and what is entered."""
    document = Document.open(folder)
    for index, measurement in enumerate(document.measurements):
        if measurement.state == 'new':
            document.set_draft(index, {'z': str(index)})
            reports.send(('typed', index))
            document.set_truth(index, *truth_of(index))
            reports.send(('entered', index))


def _run_and_kill(folder, random):
    """What a process reported until it was killed at a random moment: sets of numbers."""
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


def test_kill_at_any_moment_loses_at_most_what_is_being_typed(tmp_path):
    folder = write_small_session(str(tmp_path), count=1)
    # all measurements share their images: here only the description matters
    change_json(folder, lambda content: content.update(
        frames=[dict(content['frames'][0], id='m%d' % number) for number in range(COUNT)]))
    random, entered, kills = np.random.RandomState(5), set(), 0
    while len(entered) < COUNT:
        reports, kills = _run_and_kill(folder, random), kills + 1
        entered |= reports['entered']
        document = Document.open(folder)
        saved = set(index for index in range(COUNT) if document.measurements[index].state == 'annotated')
        assert entered <= saved and len(saved - entered) <= 1
        assert reports['typed'] <= saved | set(index for index in range(COUNT) if document.draft(index))
        assert all(document.draft(index).get('z', str(index)) == str(index) for index in range(COUNT))
        entered = saved
    assert kills > 2
    for index, measurement in enumerate(document.measurements):
        x_m, _y_m, z_m = measurement.truth_m
        assert (round(x_m, 6), round(z_m, 6)) == tuple(round(value, 6) for value in truth_of(index))
