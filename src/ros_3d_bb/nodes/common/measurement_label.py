"""Label of the next measurements, which can be set while the viewer runs."""
import contextlib

import rospy
from rosgraph.masterapi import MasterError

from ros_3d_bb.nodes.common.master import NO_ANSWER, on_new_master, patient_master


class Label(object):
    """The parameter ~label; `default` is its value if it is not set.

    Its last value is kept if the master does not respond, and is set again on a restarted master.
    """

    def __init__(self, default):
        self._default, self._newest = default, default
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

    def _restore(self):
        # rospy assumes that its subscription to the parameter persists, but a new master has lost it.
        patient_master().subscribeParam(rospy.get_node_uri(), rospy.resolve_name('~label'))
        rospy.set_param('~label', self._newest)
