"""Track IDs that remain unique when the tracker is killed and restarted."""
import rospy

from ros_3d_bb.core.latest_worker import NewestWorker
from ros_3d_bb.nodes.common.master import on_new_master

RESERVED = 1000  # IDs per reservation: a restarted tracker continues with the next thousand
LARGEST = 2 ** 31 - 1  # largest integer of a ROS parameter


class PersistentTrackIds(object):
    """Offset the IDs of a tracker by the IDs that were assigned before it was started.

    The upper limit of the reserved IDs is stored on the parameter server, which outlives the node. The parameter is
    outside the node's namespace (`/tracker_node_numbers`), because roslaunch clears private parameters. IDs are also
    assigned while the master is unreachable.

    Parameters
    ----------
    diagnostics : diagnostics.Diagnostics

    Raises
    ------
    ValueError
        If the parameter is not a valid ID.
    """

    def __init__(self, diagnostics):
        self._diagnostics, self._name = diagnostics, rospy.get_name() + '_numbers'
        self._before = rospy.get_param(self._name, 0)
        if type(self._before) is not int or not 0 <= self._before <= LARGEST - RESERVED:
            raise ValueError('parameter %s is %r; the largest number of a track so far expected'
                             % (self._name, self._before))
        self._reserved = self._before + RESERVED
        rospy.set_param(self._name, self._reserved)
        on_new_master(lambda: self._worker.offer(self._reserved))
        # In a separate thread, because an unresponsive master must not block the tracks.
        self._worker = NewestWorker(self._reserve, self._on_error)

    def assign(self, tracks):
        """Return the tracks, a list of `types.TrackedObject`, with persistent IDs."""
        tracks = [track._replace(id=self._before + track.id) for track in tracks]
        newest = max([track.id for track in tracks], default=0)
        if newest > self._reserved - RESERVED // 2:
            self._worker.offer(newest + RESERVED)
        return tracks

    def _reserve(self, number):
        rospy.set_param(self._name, number)
        self._reserved = number

    def _on_error(self, error):
        self._diagnostics.warn('numbers not reserved', 'the ROS master does not take the parameter %s (%s): a tracker '
                               'that is started again may give numbers a second time; trying again'
                               % (self._name, error))
