"""Label of the next measurements, which can be set while the viewer runs."""
import contextlib

import rospy
from rosgraph.masterapi import MasterError

from ros_3d_bb.nodes.common.master import NO_ANSWER, on_new_master, patient_master


class Label(object):
    """The parameter ~label.

    Its last value is kept if the master does not respond, and is set again on a restarted master.

    Parameters
    ----------
    first : str
        Value if the parameter is not set.
    """

    def __init__(self, first):
        self._first, self._newest = first, first
        on_new_master(self._restore)

    def asked(self):
        """Request the label from the master, because rospy's cache is updated with a delay."""
        with contextlib.suppress(*NO_ANSWER):
            try:
                self._newest = str(patient_master().getParam(rospy.resolve_name('~label')))
            except MasterError:  # the parameter is not set
                self._newest = self._first
        return self._newest

    def heard(self):
        """Return the label from rospy's cache, without a request to the master."""
        with contextlib.suppress(*NO_ANSWER):
            self._newest = str(rospy.get_param_cached('~label', self._first))
        return self._newest

    def _restore(self):
        # rospy assumes that its subscription to the parameter persists, but a new master has lost it.
        patient_master().subscribeParam(rospy.get_node_uri(), rospy.resolve_name('~label'))
        rospy.set_param('~label', self._newest)
