"""ROS node that removes tracked people from laser scans and point clouds."""
import functools
from typing import NamedTuple

import numpy as np
import rospy
import tf2_ros
from sensor_msgs.msg import LaserScan, PointCloud2

from ros_3d_bb.camera.camera_model import transform_points
from ros_3d_bb.conversions.perception_msgs import stamp_of, time_from
from ros_3d_bb.conversions.range_msgs import cloud_without, points_of_cloud, scan_without
from ros_3d_bb.core.params import TRACKS_TIMEOUT, Param, parameters
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.nodes.common.diagnostics import Diagnostics
from ros_3d_bb.nodes.common.latest_tracks import LatestTracks
from ros_3d_bb.nodes.common.startup import read_params
from ros_3d_bb.nodes.common.subscribers import subscribe
from ros_3d_bb.nodes.common.tf_lookup import Transforms
from ros_3d_bb.planning.people_removal import are_inside, cylinders_of, scan_parts, scan_points

KINDS = {'scan': LaserScan, 'points': PointCloud2}


@parameters()
class PeopleRemovalParams(NamedTuple):
    inputs: list = Param(('scan',), choices=tuple(KINDS))
    timeout: float = TRACKS_TIMEOUT
    margin: float = Param(
        0.2, 'Measurements up to this distance from the body of a person, in addition to the standard deviation of the '
        'predicted position, are removed.', 'm', limits=(0.0, 2.0))
    tf_timeout: float = Param(0.1, 'How long to wait for the transform at the stamp of the measurements.', 's')


class PeopleRemovalNode(object):
    """Remove tracked people from laser scans and point clouds.

    The outputs are for costmaps, SLAM and localisation, which take people for obstacles that stay. People are where
    their tracks predict them at the time of the measurements, in scans with a time_increment that of each beam, and
    reach the floor. Without tracks for ~timeout or a transform, measurements pass as they are, and so do those of
    another layout. Parameters: config/people_removal.yaml.

    Subscribes
    ----------
    ~scan : sensor_msgs/LaserScan
        Planar laser scan; with ~inputs scan.
    ~points : sensor_msgs/PointCloud2
        Point cloud with x, y and z as FLOAT32; with ~inputs points.
    /tf,/tf_static : tf2_msgs/TFMessage
        Poses of the sensors in the frame of the tracks.

    Publishes
    ---------
    ~scan_static : sensor_msgs/LaserScan
        The scan with NaN (REP 117: invalid) in place of people, which neither marks nor clears.
    ~points_static : sensor_msgs/PointCloud2
        The cloud without people; NaN in place of them if it is organised.
    """

    def __init__(self):
        params, = read_params(PeopleRemovalParams)
        if not params.inputs:
            raise ValueError('parameter ~inputs is empty; some of %s expected' % ', '.join(KINDS))
        self._params = params
        self._diagnostics, self._transforms = Diagnostics(), Transforms(params.tf_timeout)
        self._diagnostics.show('tf age', self._transforms.age)
        self._tracks = LatestTracks(self._diagnostics, params.timeout)
        removers = {'scan': self._without_in_scan, 'points': self._without_in_cloud}
        self._pubs = {name: rospy.Publisher('~%s_static' % name, KINDS[name], queue_size=2) for name in params.inputs}
        for name in params.inputs:
            subscribe('~' + name, KINDS[name], functools.partial(self._on_message, name, removers[name]), 2)

    def _on_message(self, name, remover, message):
        with self._diagnostics.receiving(name):
            if self._pubs[name].get_num_connections():
                self._pubs[name].publish(self._without_people(name, remover, message))

    def _without_people(self, name, remover, message):
        """Return the message without people, or itself if it is unknown where they are."""
        newest = self._tracks.newest()
        try:
            if newest is not None:
                around = functools.partial(self._around, newest, message)
                _fixed_from_sensor, cylinders = around()
                self._diagnostics.count(name + ' without people')
                return remover(message, around) if len(cylinders) else message
            self._tracks.report_missing('people are not removed')
        except tf2_ros.TransformException as error:
            self._diagnostics.warn('no transform', 'no transform from %s to %s: %s; people are not removed from %s'
                                   % (message.header.frame_id, newest.frame_id, error, name))
        except ValueError as error:  # costmaps need the measurements all the more where people are
            self._diagnostics.warn('%s with people' % name, '%s; people are not removed from %s' % (error, name))
        return message

    def _around(self, newest, message, later_s=0.0):
        """Return the pose (4, 4) of a sensor, and the cylinders of people, at a time after the stamp of a message."""
        stamp_ns = stamp_of(message) + int(later_s * NS)
        cylinders = cylinders_of(newest.tracks, (stamp_ns - newest.stamp_ns) / NS, self._params.margin)
        return self._transforms.lookup(newest.frame_id, message.header.frame_id, time_from(stamp_ns)), cylinders

    def _without_in_scan(self, message, around):
        points_m = scan_points(message.ranges, message.angle_min, message.angle_increment)
        is_removed = np.zeros(len(points_m), bool)
        for part, later_s in self._parts_of(message, around):
            fixed_from_sensor, cylinders = around(later_s)
            is_removed[part] = are_inside(transform_points(fixed_from_sensor, points_m[part]), cylinders)
        return scan_without(message, is_removed)

    def _parts_of(self, message, around):
        """Return the `scan_parts`; the whole scan, as if measured at its stamp, if there is no transform at its end."""
        parts = scan_parts(len(message.ranges), message.time_increment)
        try:
            around(parts[-1][1])
            return parts
        except tf2_ros.TransformException as error:
            self._diagnostics.warn('scan at one pose', 'no transform at the last beam of the scan: %s; the pose at its '
                                   'stamp is used for all beams' % error)
            return scan_parts(len(message.ranges), 0.0)

    def _without_in_cloud(self, message, around):
        fixed_from_sensor, cylinders = around()
        points_m = transform_points(fixed_from_sensor, points_of_cloud(message))
        return cloud_without(message, are_inside(points_m, cylinders))
