"""What a node did with its input, on /diagnostics and in the log."""
import collections
import contextlib
import threading
import time

import diagnostic_updater
import rospy
from diagnostic_msgs.msg import DiagnosticStatus

PERIOD_S = 1.0
WARNING_LASTS_S = 5.0


def is_ending():
    """Whether rospy shuts down. It closes the publishers first, under callbacks at work, and then says is_shutdown."""
    return rospy.is_shutdown() or rospy.core.is_shutdown_requested()


class Diagnostics(object):
    """Counts what happened to each input and publishes the counts on /diagnostics once a second.

    A warning is logged at most every `WARNING_LASTS_S` for one cause, and shown as the node's state for as long.
    Timed by the machine's clock: a paused bag must not silence it.
    """

    def __init__(self):
        self._counts = collections.OrderedDict()
        self._warning, self._warned_at, self._logged_at = '', None, {}
        self._updater = diagnostic_updater.Updater()
        self._updater.setHardwareID('none')
        self._updater.add('pipeline', self._report)
        thread = threading.Thread(target=self._run)
        thread.daemon = True
        thread.start()

    def count(self, event, amount=1):
        """Something went as it should."""
        self._counts[event] = self._counts.get(event, 0) + amount

    def warn(self, event, sentence):
        """Something was refused or missing; `sentence` says what, why, and what happens next."""
        self.count(event)
        now_s = time.monotonic()
        self._warning, self._warned_at = sentence, now_s
        if now_s - self._logged_at.get(event, -WARNING_LASTS_S) >= WARNING_LASTS_S:
            self._logged_at[event] = now_s
            rospy.logwarn('%s', sentence)

    @contextlib.contextmanager
    def refusing(self, inputs):
        """Around what a callback does with its input: a ValueError there refuses that one, and the node goes on."""
        try:
            yield
        except ValueError as error:
            self.warn('%s refused' % inputs, '%s refused: %s; waiting for the next' % (inputs, error))
        except rospy.ROSException:
            if not is_ending():
                raise

    def _report(self, status):
        recent = self._warned_at is not None and time.monotonic() - self._warned_at < WARNING_LASTS_S
        if recent:
            status.summary(DiagnosticStatus.WARN, self._warning)
        elif not self._counts:
            status.summary(DiagnosticStatus.STALE, 'no input yet')
        else:
            status.summary(DiagnosticStatus.OK, 'working')
        for event, amount in list(self._counts.items()):
            status.add(event, str(amount))
        return status

    def _run(self):
        while not rospy.is_shutdown():
            try:
                self._updater.force_update()
            except rospy.ROSException:
                if not is_ending():
                    raise
            time.sleep(PERIOD_S)
