"""A killed annotator loses no entered truth and no typed text."""
import multiprocessing
import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

from ros_3d_bb_annotator.document import Document
from support.small_session import change_json, write_small_session
from support.typist import truth_mm_of

COUNT = 100
LONGEST_S = 0.006  # of a random wait before the kill: about one annotation
WINDOW_KILLS = 4
TESTS = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))


def write_session(folder):
    """Session of measurements that share their images, because only the description is tested."""
    write_small_session(folder, count=1)
    change_json(folder, lambda content: content.update(
        frames=[dict(content['frames'][0], id='m%d' % number) for number in range(COUNT)]))
    return folder


def saved_in(document):
    """Indices of the annotated measurements, after a check that they contain the typed truth."""
    saved = set(index for index in range(COUNT) if document.measurements[index].state == 'annotated')
    for index in saved:
        x_m, _y_m, z_m = document.measurements[index].truth_m
        assert (round(1000 * x_m, 3), round(1000 * z_m, 3)) == truth_mm_of(index)
    return saved


def _annotate(folder, reports):
    """Annotate new measurements, and report typed and entered ones."""
    document = Document.open(folder)
    for index, measurement in enumerate(document.measurements):
        if measurement.state == 'new':
            document.set_draft(index, {'z': str(index)})
            reports.send(('typed', index))
            document.set_truth(index, *(value_mm / 1000.0 for value_mm in truth_mm_of(index)))
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
def test_kill_at_any_moment_loses_at_most_what_is_being_typed(tmp_path):
    folder = write_session(str(tmp_path))
    random, entered, kills = np.random.RandomState(5), set(), 0
    while len(entered) < COUNT:
        reports, kills = _run_and_kill(folder, random), kills + 1
        entered |= reports['entered']
        document = Document.open(folder)
        saved = saved_in(document)
        assert entered <= saved and len(saved - entered) <= 1
        assert reports['typed'] <= saved | set(index for index in range(COUNT) if document.draft(index))
        assert all(document.draft(index).get('z', str(index)) == str(index) for index in range(COUNT))
        entered = saved
    assert kills > 2


def _type_and_kill(folder, to_wait_for, wait_s):
    """Indices that a window in another process reported as entered, until it was killed `wait_s` after `to_wait_for`
    reports. With fewer reports it ends by itself.
    """
    environment = dict(os.environ, PYTHONPATH=os.pathsep.join([TESTS] + sys.path), QT_QPA_PLATFORM='offscreen')
    process = subprocess.Popen([sys.executable, '-m', 'support.typist', folder], env=environment,
                               stdout=subprocess.PIPE, universal_newlines=True)
    entered = set()
    for number, line in enumerate(process.stdout):
        kind, index = line.split()
        if kind == 'entered':
            entered.add(int(index))
        if number == to_wait_for:
            time.sleep(wait_s)
            process.kill()
    return entered, process.wait()


@pytest.mark.slow
def test_kill_of_the_window_at_any_moment_loses_at_most_what_is_being_typed(tmp_path):
    folder = write_session(str(tmp_path))
    random, entered = np.random.RandomState(6), set()
    for kill in range(WINDOW_KILLS + 1):
        to_wait_for = random.randint(COUNT // WINDOW_KILLS) if kill < WINDOW_KILLS else 2 * COUNT
        reported, status = _type_and_kill(folder, to_wait_for, random.uniform(0, 0.05))
        assert status == (-signal.SIGKILL if kill < WINDOW_KILLS else 0)
        entered |= reported
        saved = saved_in(Document.open(folder))
        assert entered <= saved and len(saved - entered) <= 1
        entered = saved
    assert entered == set(range(COUNT))
