"""Label of measurements: the parameter ~label, and its entry by the keys of a window."""
import contextlib

import rospy
from rosgraph.masterapi import MasterError

from ros_3d_bb.nodes.common.master import NO_ANSWER, on_new_master, patient_master

ENTER, ESCAPE, BACKSPACE = '\r\n', '\x1b', '\b\x7f'
LONGEST = 40


class Label(object):
    """The parameter ~label, `default` if unset; kept without a master, and set again on a restarted one.

    `typed` is the text that is being entered by keys, or None.
    """

    def __init__(self, default):
        self._default, self._newest, self.typed = default, default, None
        on_new_master(self._restore)

    def from_master(self):
        """Request the label from the master, because rospy's cache is updated with a delay."""
        with contextlib.suppress(*NO_ANSWER):
            try:
                self._newest = str(patient_master().getParam(rospy.resolve_name('~label')))
            except MasterError:  # the parameter is not set
                self._newest = self._default
        return self._newest

    def from_cache(self):
        """Return the label from rospy's cache, without a request to the master."""
        with contextlib.suppress(*NO_ANSWER):
            self._newest = str(rospy.get_param_cached('~label', self._default))
        return self._newest

    def start_typing(self):
        self.typed = ''

    def type(self, key):
        """Add a key to the typed text. Enter sets the label, Escape keeps the old one."""
        if key and key in ENTER:
            self._newest, self.typed = self.typed.strip(), None
            with contextlib.suppress(*NO_ANSWER):
                rospy.set_param('~label', self._newest)
        elif key == ESCAPE:
            self.typed = None
        elif key and key in BACKSPACE:
            self.typed = self.typed[:-1]
        elif key.isprintable():
            self.typed = (self.typed + key)[:LONGEST]

    def _restore(self):
        # rospy assumes that its subscription to the parameter persists, but a new master has lost it.
        patient_master().subscribeParam(rospy.get_node_uri(), rospy.resolve_name('~label'))
        rospy.set_param('~label', self._newest)
