"""Countdown and burst of measurements, for people who cannot reach the keyboard from the floor mark."""

GIVE_UP_S = 5.0  # without a measurement


class Burst(object):
    """A countdown of `delay_s` followed by `count` measurements every `interval_s`. Times are those of the caller."""

    def __init__(self, delay_s, count, interval_s):
        self._delay_s, self._count, self._interval_s = delay_s, count, interval_s
        self._left, self._next_s, self._failed_s = 0, 0.0, None

    @property
    def is_active(self):
        return self._left > 0

    def toggle(self, now_s):
        self._left, self._next_s, self._failed_s = 0 if self.is_active else self._count, now_s + self._delay_s, None

    def is_due(self, now_s):
        return self.is_active and now_s >= self._next_s

    def report(self, now_s, is_stored):
        """Report whether the due measurement was stored. It is repeated if not, until GIVE_UP_S have passed."""
        if is_stored:
            self._left, self._next_s, self._failed_s = max(0, self._left - 1), now_s + self._interval_s, None
        elif self._failed_s is None:
            self._failed_s = now_s
        elif now_s - self._failed_s > GIVE_UP_S:
            self._left = 0

    def text(self, now_s):
        """Text to be shown: seconds of the countdown, or the measurement that is due; '' if inactive."""
        if not self.is_active:
            return ''
        if self._left == self._count and now_s < self._next_s:
            return '%d' % (int(self._next_s - now_s) + 1)
        return '%d/%d' % (self._count - self._left + 1, self._count)
