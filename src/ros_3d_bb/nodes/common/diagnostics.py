"""What a node did with its input, on /diagnostics and in the log."""
import collections
import threading
import time

import diagnostic_updater
import rospy
from diagnostic_msgs.msg import DiagnosticStatus

from ros_3d_bb.core.event_counter import MOST_LAGS, EventCounter
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.nodes.common.input_monitor import InputWatch, unheard

PERIOD_S = 1.0
WARNING_LASTS_S = 5.0
REMINDER_S = 30.0  # between two lines of the log about what stays wrong
UNHEARD_S = 5.0  # without subscribers; they may be starting, too


def is_ending():
    """Whether rospy shuts down. It closes the publishers first, under callbacks at work, and then says is_shutdown."""
    return rospy.is_shutdown() or rospy.core.is_shutdown_requested()


class Diagnostics(EventCounter):
    """Counts the messages that came and what happened to each, and publishes that on /diagnostics once a second, with
    rates, latency and what else the node shows.

    A warning is logged at most every `WARNING_LASTS_S` for one cause, and shown as the node's state for as long. What
    is wrong around it (see `check`) is its state while it lasts. Timed by the machine's clock: a paused bag must not
    silence it.

    Publishes
    ---------
    /diagnostics : diagnostic_msgs/DiagnosticArray
        What the node did with its input, and what it is missing, once a second.
    """

    def __init__(self):
        super(Diagnostics, self).__init__(clock=rospy.get_rostime)
        self._warning, self._warned_at = '', None
        self._logged_at, self._lasted = {}, set()
        self._looked_s, self._heard_s = time.monotonic(), time.monotonic()
        inputs = InputWatch()
        self._shown, self._checks = [inputs.values], [inputs.faults]
        self._updater = diagnostic_updater.Updater()
        self._updater.setHardwareID('none')
        self._updater.add('pipeline', self._report)
        thread = threading.Thread(target=self._run)
        thread.daemon = True
        thread.start()

    def note(self, event, sentence):
        """Something happened that one should know of."""
        rospy.loginfo('%s', sentence)
        super(Diagnostics, self).note(event, sentence)

    def warn(self, event, sentence):
        """Something was refused or missing; `sentence` says what, why, and what happens next."""
        self.count(event)
        self._warning, self._warned_at = sentence, time.monotonic()
        self._log(event, sentence, WARNING_LASTS_S)

    def show(self, name, text):
        """Add a value to what is published: `text()` is asked for it once a second."""
        self._shown.append(lambda: [(name, text())])

    def check(self, faults):
        """Ask `faults()` once a second what is wrong now: (event, sentence) pairs."""
        self._checks.append(faults)

    def is_harmless(self, error):
        """rospy closes publishers under callbacks that still run when it shuts down."""
        return isinstance(error, rospy.ROSException) and is_ending()

    def _report(self, status):
        recent = self._warned_at is not None and time.monotonic() - self._warned_at < WARNING_LASTS_S
        lasting = self._lasting()
        self._note_unheard()
        if recent:
            status.summary(DiagnosticStatus.WARN, self._warning)
        elif lasting:
            status.summary(DiagnosticStatus.WARN, lasting[0])
        elif not self.counts:
            status.summary(DiagnosticStatus.STALE, 'no input yet')
        else:
            status.summary(DiagnosticStatus.OK, 'working')
        for event, amount in self.counters():
            status.add(event, str(amount))
        for name, text in self._answers() + [entry for shown in self._shown for entry in shown()]:
            status.add(name, text)
        return status

    def counters(self):
        """What is published of the input: (event, how often), and (inputs received, how many)."""
        return list(self.counts.items()) + [('%s received' % inputs, amount)
                                            for inputs, amount in list(self.received.items())]

    def _lasting(self):
        """The sentences about what is wrong now; each is logged when it begins, and now and then."""
        faults = [fault for check in self._checks for fault in check()]
        before, self._lasted = self._lasted, set(event for event, _sentence in faults)
        for event, sentence in faults:
            self._log(event, sentence, REMINDER_S if event in before else WARNING_LASTS_S)
        return [sentence for _event, sentence in faults]

    def _log(self, event, sentence, pause_s):
        """Log a warning, unless the last one about the event is less than a pause ago."""
        now_s = time.monotonic()
        if now_s - self._logged_at.get(event, float('-inf')) >= pause_s:
            self._logged_at[event] = now_s
            rospy.logwarn('%s', sentence)

    def _note_unheard(self):
        """Say once that nobody subscribes, and again after somebody did: that is no fault of the node."""
        now_s, topics = time.monotonic(), unheard()
        if not topics:
            self._heard_s = now_s
        elif self._heard_s is not None and now_s - self._heard_s > UNHEARD_S:
            self._heard_s = None
            rospy.loginfo('nobody subscribes %s: nobody sees what this node finds', ' or '.join(topics))

    def _answers(self):
        """(name, text) of what was answered since the last report."""
        lags_ns, self.lags_ns = self.lags_ns, collections.deque(maxlen=MOST_LAGS)
        now_s = time.monotonic()
        passed_s, self._looked_s = max(now_s - self._looked_s, 1e-3), now_s
        answers = [('rate', '%.1f Hz' % (len(lags_ns) / passed_s))]
        if lags_ns:
            mean_ms, most_ms = (1000 * lag_ns / NS for lag_ns in (sum(lags_ns) / len(lags_ns), max(lags_ns)))
            answers.append(('latency', 'mean %.1f ms, most %.1f ms from stamp to result' % (mean_ms, most_ms)))
        return answers

    def _run(self):
        while not rospy.is_shutdown():
            try:
                self._updater.force_update()
            except Exception as error:  # one report must not end the thread
                if not is_ending():
                    self._log('no report', 'what this node did cannot be reported on /diagnostics (%r); trying again'
                              % error, WARNING_LASTS_S)
            time.sleep(PERIOD_S)
