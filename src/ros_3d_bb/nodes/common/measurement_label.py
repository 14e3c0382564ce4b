"""The label of the measurements to come, which people set while the viewer runs."""
import contextlib

import rospy
from rosgraph.masterapi import MasterError

from ros_3d_bb.nodes.common.master import NO_ANSWER, patient_master
from ros_3d_bb.nodes.common.master_registration import on_new_master


class Label(object):
    """The parameter ~label; as it was before where no master answers, and a new master is told it.

    Parameters
    ----------
    first : str
        What it is where the parameter is not set.
    """

    def __init__(self, first):
        self._first, self._newest = first, first
        on_new_master(self._restore)

    def asked(self):
        """As the master has it: rospy's cache hears of a label some time after it was set."""
        with contextlib.suppress(*NO_ANSWER):
            try:
                self._newest = str(patient_master().getParam(rospy.resolve_name('~label')))
            except MasterError:  # it is not set
                self._newest = self._first
        return self._newest

    def heard(self):
        """As rospy's cache has it, which costs the master nothing."""
        with contextlib.suppress(*NO_ANSWER):
            self._newest = str(rospy.get_param_cached('~label', self._first))
        return self._newest

    def _restore(self):
        # rospy believes that it has subscribed the parameter, and a new master knows nothing of that
        patient_master().subscribeParam(rospy.get_node_uri(), rospy.resolve_name('~label'))
        rospy.set_param('~label', self._newest)
