"""Numbers of tracks that stay unique when the tracker is killed and started again."""
import rospy

from ros_3d_bb.core.latest_worker import NewestWorker
from ros_3d_bb.nodes.common.master_registration import on_new_master

RESERVED = 1000  # numbers at a time: whoever is started again goes on with the next thousand
LARGEST = 2 ** 31 - 1  # that a ROS parameter holds


class PersistentTrackIds(object):
    """Adds to the numbers that a tracker gives those that were given before it was started.

    The parameter server, which outlives the node, remembers up to where numbers are reserved; the parameter is beside
    the node's own ones (`/tracker_node_numbers`), as roslaunch clears those. Without the master numbers go on.

    Parameters
    ----------
    diagnostics : diagnostics.Diagnostics

    Raises
    ------
    ValueError
        If the parameter holds something else.
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
        # In a thread of its own, as a master that does not answer must not hold up the tracks.
        self._worker = NewestWorker(self._reserve, self._on_error)

    def assign(self, tracks):
        """The tracks, a list of `types.TrackedObject`, with their numbers among all."""
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
