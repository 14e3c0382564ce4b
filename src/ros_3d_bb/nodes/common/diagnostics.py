"""Diagnostics of a node: outcome of its inputs, rates, latency and faults, on /diagnostics and in the log."""
import collections
import threading
import time

import rospy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from std_msgs.msg import Header

from ros_3d_bb.core.event_counter import EventCounter
from ros_3d_bb.core.params import with_places
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.nodes.common.master import is_ending
from ros_3d_bb.nodes.common.startup import Part, launch_places
from ros_3d_bb.nodes.common.subscribers import InputMonitor

PERIOD_S = 1.0
WARNING_LASTS_S = 5.0
REMINDER_S = 30.0  # between two log lines about a persistent fault
MOST_LAGS = 10000  # maximum number of stored latencies


class Diagnostics(EventCounter):
    """Count received messages and their outcomes, and publish the counters on /diagnostics once per second, with
    rates, latency and further values of the node.

    Warnings with the same cause are logged at most every `WARNING_LASTS_S`, and determine the status of the node for
    the same time. External faults (see `check`) determine it while they last. Wall-clock time is used, so that a
    paused bag does not stop the reports.

    Publishes
    ---------
    /diagnostics : diagnostic_msgs/DiagnosticArray
        Counters of processed and rejected inputs, rates, latency and missing inputs, once per second.
    """

    def __init__(self, part=Part()):
        super(Diagnostics, self).__init__()
        self._lags_ns = collections.deque(maxlen=MOST_LAGS)  # latencies of the newest results
        self._warning, self._warned_at = '', float('-inf')
        self._logged_at, self._current_events = {}, set()
        self._reported_s = time.monotonic()
        self._shown, self._checks = [], []
        if part.monitors:
            inputs = InputMonitor()
            self._shown.append(inputs.values)
            self._checks.append(inputs.faults)
        self._place_of = launch_places([part.node_name.rpartition('/')[2]])
        self._status_name = '%s: pipeline' % part.node_name.lstrip('/')
        self._publisher = rospy.Publisher('/diagnostics', DiagnosticArray, queue_size=10)
        threading.Thread(target=self._run, daemon=True).start()

    def note(self, event, sentence):
        """Count an event and log `sentence` as information."""
        rospy.loginfo('%s', with_places(sentence, self._place_of))
        super(Diagnostics, self).note(event, sentence)

    def warn(self, event, sentence):
        """Count a rejected or missing input; `sentence` states what failed, why, and what happens next."""
        self.count(event)
        sentence = with_places(sentence, self._place_of)
        self._warning, self._warned_at = sentence, time.monotonic()
        self._log(event, sentence, WARNING_LASTS_S)

    def warn_unless(self, is_expected, event, sentence):
        """Warn, or only count the event if it is expected, as for a moment after a jump in time."""
        if is_expected:
            self.count(event)
        else:
            self.warn(event, sentence)

    def show(self, name, text):
        """Add a value to the published status; `text()` is called once per second and returns it."""
        self._shown.append(lambda: [(name, text())])

    def check(self, faults):
        """Register a check; `faults()` is called once per second and yields (event, sentence) for current faults."""
        self._checks.append(faults)

    def is_harmless(self, error):
        """Whether an exception results from shutdown, when rospy closes publishers during running callbacks."""
        return isinstance(error, rospy.ROSException) and is_ending()

    def _report(self):
        is_recent = time.monotonic() - self._warned_at < WARNING_LASTS_S
        faults, totals = self._current_faults(), self.totals()
        if is_recent:
            level, sentence = DiagnosticStatus.WARN, self._warning
        elif faults:
            level, sentence = DiagnosticStatus.WARN, faults[0]
        elif not totals:
            level, sentence = DiagnosticStatus.STALE, 'no input yet'
        else:
            level, sentence = DiagnosticStatus.OK, 'working'
        entries = [KeyValue(name, str(amount)) for name, amount in totals.items()]
        for values in [self._rate_and_latency] + self._shown:
            entries += [KeyValue(name, text) for name, text in values()]
        status = DiagnosticStatus(level, self._status_name, sentence, 'none', entries)
        self._publisher.publish(DiagnosticArray(header=Header(stamp=rospy.get_rostime()), status=[status]))

    def _current_faults(self):
        """Return the sentences about current faults. Each is logged when it first occurs and then every REMINDER_S."""
        faults = [fault for check in self._checks for fault in check()]
        before, self._current_events = self._current_events, set(event for event, _sentence in faults)
        for event, sentence in faults:
            self._log(event, sentence, REMINDER_S if event in before else WARNING_LASTS_S)
        return [sentence for _event, sentence in faults]

    def _log(self, event, sentence, pause_s):
        """Log a warning, unless the last one about the same event was less than `pause_s` ago."""
        now_s = time.monotonic()
        if now_s - self._logged_at.get(event, float('-inf')) >= pause_s:
            self._logged_at[event] = now_s
            rospy.logwarn('%s', sentence)

    def record_latency(self, stamp):
        """Record the latency of a processed image, with or without a result, for the reported rate and latency."""
        self._lags_ns.append(rospy.get_rostime().to_nsec() - stamp.to_nsec())

    def _rate_and_latency(self):
        """Yield (name, text) of the rate and latency of the results since the last report."""
        lags_ns, self._lags_ns = self._lags_ns, collections.deque(maxlen=MOST_LAGS)
        now_s = time.monotonic()
        passed_s, self._reported_s = max(now_s - self._reported_s, 1e-3), now_s
        yield 'rate', '%.1f Hz' % (len(lags_ns) / passed_s)
        if lags_ns:
            mean_ms, max_ms = (1000 * lag_ns / NS for lag_ns in (sum(lags_ns) / len(lags_ns), max(lags_ns)))
            yield 'latency', 'mean %.1f ms, maximum %.1f ms from stamp to result' % (mean_ms, max_ms)

    def _run(self):
        while not rospy.is_shutdown():
            try:
                self._report()
            except Exception as error:  # a failed report must not end the thread
                if not is_ending():
                    self._log('no report', 'the report on /diagnostics failed (%r); trying again' % error,
                              WARNING_LASTS_S)
            time.sleep(PERIOD_S)
