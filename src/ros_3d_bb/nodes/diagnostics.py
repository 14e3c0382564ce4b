"""What a node did with its input, on /diagnostics and in the log."""
import contextlib
import threading
import time

import diagnostic_updater
import rospy
from diagnostic_msgs.msg import DiagnosticStatus

from ros_3d_bb.tally import Tally

PERIOD_S = 1.0
WARNING_LASTS_S = 5.0


def is_ending():
    """Whether rospy shuts down. It closes the publishers first, under callbacks at work, and then says is_shutdown."""
    return rospy.is_shutdown() or rospy.core.is_shutdown_requested()


class Diagnostics(Tally):
    """Counts what happened to each input and publishes the counts on /diagnostics once a second.

    A warning is logged at most every `WARNING_LASTS_S` for one cause, and shown as the node's state for as long.
    Timed by the machine's clock: a paused bag must not silence it.

    Publishes
    ---------
    /diagnostics : diagnostic_msgs/DiagnosticArray
        What the node did with its input, and what it is missing, once a second.
    """

    def __init__(self):
        super(Diagnostics, self).__init__()
        self._warning, self._warned_at, self._logged_at = '', None, {}
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
        now_s = time.monotonic()
        self._warning, self._warned_at = sentence, now_s
        if now_s - self._logged_at.get(event, -WARNING_LASTS_S) >= WARNING_LASTS_S:
            self._logged_at[event] = now_s
            rospy.logwarn('%s', sentence)

    @contextlib.contextmanager
    def refusing(self, inputs):
        """Around what a callback does with its input: a ValueError there refuses that one, and the node goes on."""
        try:
            with super(Diagnostics, self).refusing(inputs):
                yield
        except rospy.ROSException:
            if not is_ending():
                raise

    def _report(self, status):
        recent = self._warned_at is not None and time.monotonic() - self._warned_at < WARNING_LASTS_S
        if recent:
            status.summary(DiagnosticStatus.WARN, self._warning)
        elif not self.counts:
            status.summary(DiagnosticStatus.STALE, 'no input yet')
        else:
            status.summary(DiagnosticStatus.OK, 'working')
        for event, amount in list(self.counts.items()):
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
