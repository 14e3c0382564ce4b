"""Runs the graph, brings the faults about one after the other, and writes down what comes."""
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
from soak.records import INTERRUPTED, FaultDone, Record
from soak.witness import Witness

START_S = 180.0  # a detector may have to export its network first
RECOVERY_S = 60.0  # what has not come back by then, or within --recover-within, does not come back
QUIET_S = 3.0, 8.0  # between two faults, shortest and longest
QUIET_SHARE = 1 / 60.0  # of a soak that is so short that this is less
SHORTEST_S, LONGEST_S = 2.0, 10.0  # of a fault; a short soak has shorter ones
POLL_S = 0.02
PROGRESS_S = 0.5
SETTLING_S = 4.0  # the nodes tell their counts every second


class Interrupted(Exception):
    """Somebody pressed Ctrl-C."""


class Rig(object):
    """What faults work on: `camera`, `graph`, `witness`, and who was `killed`.

    Of the seed are `source`, which says what comes when, and `wrong_source` of wrong messages: these depend on how many
    images the machine sends, and must not change what comes next.
    """

    def __init__(self, graph, scenes, arguments):
        self.graph, self.killed, self.faults = graph, set(), []
        self.source, self.wrong_source = hostile.Source(arguments.seed), hostile.Source(arguments.seed + 1)
        self.witness, self.camera = Witness(graph), Camera(scenes, arguments.rate)
        self._stopped = threading.Event()
        self._seconds, self._patience_s = 60 * arguments.minutes, max(RECOVERY_S, arguments.recover_within)
        self._quiet_s = min(QUIET_S[0], QUIET_SHARE * self._seconds)
        self._began_s, self._shown_s, self._doing = time.monotonic(), 0.0, 'starting'
        signal.signal(signal.SIGINT, lambda *_: self._stopped.set())

    @property
    def ends_s(self):
        """When it is to end."""
        return self._began_s + self._seconds

    def wait(self, seconds):
        """Raises Interrupted, GraphEnded."""
        ends_s = time.monotonic() + seconds
        while time.monotonic() < ends_s:
            self._look()

    def wait_until(self, condition, what, longest_s=START_S):
        """Raises Interrupted, and GraphEnded where it does not come."""
        gives_up_s = time.monotonic() + longest_s
        while not condition():
            if time.monotonic() > gives_up_s:
                raise GraphEnded('%.0f s were not enough for %s' % (longest_s, what))
            self._look()

    def _look(self):
        self.graph.check()
        if self._stopped.is_set():
            raise Interrupted()
        now_s = time.monotonic()
        if now_s - self._shown_s > PROGRESS_S:
            self._shown_s = now_s
            self._show(min(1.0, (now_s - self._began_s) / self._seconds))
        time.sleep(POLL_S)

    def _show(self, share):
        sys.stderr.write('\r[%-30s] %3d %%  %5d images, %5d answered, %3d faults; %-36s' % (
            '#' * int(30 * share), int(100 * share), len(self.camera.images),
            len(self.witness.arrivals[TRACKS_TOPIC]), len(self.faults), self._doing))
        sys.stderr.flush()

    def begin(self):
        """Wait for the first tracks; from then on it counts."""
        self.wait_until(lambda: self.witness.tracks, 'the first tracks')
        self._began_s = time.monotonic()

    def play(self):
        """Fault after fault, each kind once before any comes again. Raises Interrupted, GraphEnded."""
        self._doing = 'no fault'
        self.wait(self._quiet_s)
        while True:
            for kind in self.source.sample(FAULTS, len(FAULTS)):
                if time.monotonic() >= self.ends_s:
                    return
                self._fault(*kind)
                self._doing = 'no fault'
                quiet_s = self.source.uniform(*QUIET_S) if self._seconds > 300 else self._quiet_s
                self.wait(max(0.0, min(quiet_s, self.ends_s - time.monotonic())))

    def _fault(self, fault, lasts, disturbs):
        longest_s = min(LONGEST_S, max(SHORTEST_S, self._seconds / 30))
        began_s, number = time.monotonic(), len(self.faults)
        self.faults.append(FaultDone(INTERRUPTED, began_s, began_s, None, disturbs))
        with fault(self) as name:
            self._doing = name
            self.wait(self.source.uniform(SHORTEST_S, longest_s) if lasts else 0.0)
        ended_s, sent = time.monotonic(), len(self.camera.images)
        self._doing = 'after: %s' % name
        recovered_s = self._recovered_s(sent)
        self.faults[number] = FaultDone(name, began_s, ended_s, recovered_s, disturbs)

    def _recovered_s(self, sent):
        """When one of the images after the first `sent` was answered; None: never. Raises Interrupted, GraphEnded."""
        try:
            self.wait_until(lambda: self._answered_since(sent), 'an answer', self._patience_s)
            return time.monotonic()
        except GraphEnded:
            self.graph.check()  # no recovery is a finding; no graph is the end
            return None

    def _answered_since(self, sent):
        """Whether one of the images after the first `sent` was answered by tracks."""
        new_ns = set(stamp_ns for stamp_ns, _sent_s in self.camera.images[sent:])
        return any(stamp_ns in new_ns for _at_s, stamp_ns in self.witness.arrivals[TRACKS_TOPIC][-20:])

    def settle(self):
        """Let the nodes tell what became of the last inputs. A second Ctrl-C ends that, too."""
        self._stopped.clear()
        self._doing = 'waiting for the last counts'
        self.camera.stop()
        self.wait(SETTLING_S)
        try:
            self.wait_until(lambda: outcomes_are_known(self.witness.statuses), 'the last counts', self._patience_s)
        except GraphEnded:
            self.graph.check()  # an input without an outcome is a finding

    def record(self):
        """What was written down."""
        witness, camera, graph = self.witness, self.camera, self.graph
        return Record(self._began_s, time.monotonic(), list(camera.images), set(camera.wrong_ns), dict(camera.sent),
                      {topic: list(arrivals) for topic, arrivals in witness.arrivals.items()}, list(witness.tracks),
                      list(witness.statuses), list(self.faults), list(graph.deaths), set(self.killed),
                      list(graph.errors))


def soak(arguments, port, folder):
    """Run it.

    Returns
    -------
    (Record or None, dict or str, bool)
        What was written down, with how many arrays were empty by topic; or None and why there is nothing; and whether
        somebody ended it.
    """
    options = {'detector': arguments.detector, 'weights': arguments.weights or ''}
    try:
        scenes = [rendered(read_scenario(path), arguments.images, arguments.detector == 'none')
                  for path in arguments.scenarios]
        with Graph(folder, port, ['%s:=%s' % option for option in options.items()]) as graph:
            _wait_for_master(graph)
            rospy.init_node('soak', disable_signals=True)
            rig = Rig(graph, scenes, arguments)
            interrupted = _played(rig)
            return rig.record(), dict(rig.witness.empty), interrupted
    except (GraphEnded, ValueError, OSError) as error:
        return None, '%s%s' % (error, _tail(folder)), False
    except KeyboardInterrupt:
        return None, 'ended before it began', False


def _played(rig):
    """Play it all; whether somebody ended it."""
    interrupted = False
    try:
        rig.begin()
        rig.play()
    except Interrupted:
        interrupted = True
    try:
        rig.settle()
    except Interrupted:
        interrupted = True
    sys.stderr.write('\n')
    return interrupted


def _wait_for_master(graph):
    gives_up_s = time.monotonic() + START_S
    while not rospy.core.rosgraph.is_master_online():
        graph.check()
        if time.monotonic() > gives_up_s:
            raise GraphEnded('no ROS master came')
        time.sleep(0.1)


def _tail(folder):
    path = os.path.join(folder, 'launch.log')
    if not os.path.exists(path):
        return ''
    with open(path) as stream:
        return '\nThe end of its log:\n%s' % ''.join(stream.readlines()[-30:])
