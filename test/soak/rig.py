"""Runs the graph, injects one fault after the other, and records the outputs."""
import os
import signal
import sys
import threading
import time

import rospy

from fuzz import hostile
from ros_3d_bb.conversions.perception_msgs import TRACKS_TOPIC
from ros_3d_bb_lab.simulation.scenario import read_scenario
from soak.camera import Camera, rendered
from soak.faults import FAULTS
from soak.graph import Graph, GraphEnded
from soak.invariants import outcomes_are_known
from soak.records import INTERRUPTED, Fault, Record
from soak.witness import Witness

START_S = 180.0  # includes the time for exporting the network of a detector
RECOVERY_S = 60.0  # time without recovery, or --recover-within, after which a fault counts as permanent
QUIET_S, QUIET_SHARE = (3.0, 8.0), 1 / 60.0  # shortest and longest time between faults; share of a short soak
SHORTEST_S, LONGEST_S = 2.0, 10.0  # duration of a fault; at most a 30th of the soak
POLL_S, PROGRESS_S = 0.02, 0.5
SETTLING_S = 4.0  # nodes publish their counters every second


class Interrupted(Exception):
    """Ctrl-C was pressed."""


class Rig(object):
    """Interface of the faults: `camera`, `graph`, `witness`, and the process IDs that were `killed`.

    `source` determines the sequence of faults. Invalid messages have their own `wrong_source`, because their number
    depends on how many images the machine sends.
    """

    def __init__(self, graph, scenes, arguments):
        self.graph, self.killed, self.faults = graph, set(), []
        self.source, self.wrong_source = hostile.Source(arguments.seed), hostile.Source(arguments.seed + 1)
        self.witness, self.camera = Witness(graph), Camera(scenes, arguments.rate)
        self._stopped = threading.Event()
        self._seconds, self._patience_s = 60 * arguments.minutes, max(RECOVERY_S, arguments.recover_within)
        self._began_s, self._shown_s, self._activity = time.monotonic(), 0.0, 'starting'
        signal.signal(signal.SIGINT, lambda *_: self._stopped.set())

    def wait(self, seconds):
        """Raises Interrupted, GraphEnded."""
        ends_s = time.monotonic() + seconds
        while time.monotonic() < ends_s:
            self._poll()

    def wait_until(self, condition, what, longest_s=START_S):
        """Raises Interrupted, and GraphEnded if the condition is not met in time."""
        ends_s = time.monotonic() + longest_s
        while not condition():
            if time.monotonic() > ends_s:
                raise self.graph.failure('no %s within %.0f s' % (what, longest_s))
            self._poll()

    def _poll(self):
        self.graph.check()
        if self._stopped.is_set():
            raise Interrupted()
        now_s = time.monotonic()
        if now_s - self._shown_s > PROGRESS_S:
            self._shown_s = now_s
            share = min(1.0, (now_s - self._began_s) / self._seconds)
            sys.stderr.write('\r[%-30s] %3d %%  %5d images, %5d answered, %3d faults; %-36s' % (
                '#' * int(30 * share), int(100 * share), len(self.camera.images),
                len(self.witness.arrivals[TRACKS_TOPIC]), len(self.faults), self._activity))
            sys.stderr.flush()
        time.sleep(POLL_S)

    def play(self):
        """Inject the faults in random order, each kind once before any is repeated. Raises Interrupted, GraphEnded."""
        self.wait_until(lambda: self.witness.tracks, 'tracks')
        self._began_s = time.monotonic()
        ends_s = self._began_s + self._seconds
        short_quiet_s = min(QUIET_S[0], QUIET_SHARE * self._seconds)
        self._activity = 'no fault'
        self.wait(short_quiet_s)
        while True:
            for kind in self.source.sample(FAULTS, len(FAULTS)):
                if time.monotonic() >= ends_s:
                    return
                self._inject(*kind)
                self._activity = 'no fault'
                quiet_s = self.source.uniform(*QUIET_S) if self._seconds > 300 else short_quiet_s
                self.wait(max(0.0, min(quiet_s, ends_s - time.monotonic())))

    def _inject(self, fault, lasts, disorders):
        longest_s = min(LONGEST_S, max(SHORTEST_S, self._seconds / 30))
        began_s = time.monotonic()
        self.faults.append(Fault(INTERRUPTED, began_s, began_s, None, disorders))
        with fault(self) as name:
            self._activity = name
            self.wait(self.source.uniform(SHORTEST_S, longest_s) if lasts else 0.0)
        ended_s, sent = time.monotonic(), len(self.camera.images)
        self._activity = 'after: %s' % name
        recovered_s = time.monotonic() if self._is_met(lambda: self._is_answered_since(sent)) else None
        self.faults[-1] = Fault(name, began_s, ended_s, recovered_s, disorders)

    def _is_met(self, condition):
        """Wait for a condition. If it is not met, the invariants report it; only the end of the graph is an error."""
        try:
            self.wait_until(condition, 'answer', self._patience_s)
        except GraphEnded:
            self.graph.check()
        return condition()

    def _is_answered_since(self, sent):
        """Whether one of the images after the first `sent` was answered with tracks."""
        new_ns = set(stamp_ns for stamp_ns, _sent_s in self.camera.images[sent:])
        return any(stamp_ns in new_ns for _at_s, stamp_ns in self.witness.arrivals[TRACKS_TOPIC][-20:])

    def settle(self):
        """Wait for the outcomes of the last inputs. A second Ctrl-C ends this."""
        self._stopped.clear()
        self._activity = 'waiting for the last counters'
        self.camera.stop()
        self.wait(SETTLING_S)
        self._is_met(lambda: outcomes_are_known(self.witness.statuses))

    def record(self):
        """Copy of everything that was measured."""
        witness, camera, graph = self.witness, self.camera, self.graph
        return Record(self._began_s, time.monotonic(), list(camera.images), set(camera.wrong_ns), dict(camera.sent),
                      {topic: list(arrivals) for topic, arrivals in witness.arrivals.items()}, dict(witness.empty),
                      list(witness.tracks), list(witness.statuses), list(self.faults), list(graph.deaths),
                      set(self.killed), list(graph.errors))


def soak(arguments, port, folder):
    """Run a soak. Returns its Record, and whether it was interrupted. Raises GraphEnded, ValueError, OSError."""
    scenes = [rendered(read_scenario(path), arguments.images, arguments.detector == 'none')
              for path in arguments.scenarios]
    options = ['detector:=%s' % arguments.detector, 'weights:=%s' % (arguments.weights or '')]
    interrupted = False
    with Graph(os.path.join(folder, 'launch.log'), port, options) as graph:
        graph.wait_for_master(START_S)
        rospy.init_node('soak', disable_signals=True)
        rig = Rig(graph, scenes, arguments)
        for phase in (rig.play, rig.settle):
            try:
                phase()
            except Interrupted:
                interrupted = True
        sys.stderr.write('\n')
        return rig.record(), interrupted
