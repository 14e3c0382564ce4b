"""Command `doctor`: find the faults of a running pipeline or of a bag, and suggest a fix for each."""
import argparse
import os
import socket
import sys
import time
from urllib.parse import urlparse

import rosgraph
import rospy

from ros_3d_bb.bags.bag_reader import BagError
from ros_3d_bb.core.params import params_from
from ros_3d_bb.diagnosis.bag_observer import observe_bag
from ros_3d_bb.diagnosis.checks import findings
from ros_3d_bb.diagnosis.observations import Finding
from ros_3d_bb.nodes.common.graph_observer import GraphObserver, name_for, tracker_param
from ros_3d_bb.nodes.common.master import NO_ANSWER, PATIENCE_S, patient_master
from ros_3d_bb.pipeline.tracking_stage import TrackerNodeParams

LOCAL = 'localhost', '127.0.0.1', '127.0.1.1', '::1'


def main():
    """Run the command. The exit status is 0 if no fault is found and 1 otherwise."""
    arguments = _parser().parse_args(rospy.myargv()[1:])
    if arguments.bag:
        found = bag_findings(arguments)
    else:
        found = machine_findings()
        if not any(finding.is_wrong for finding in found):
            rospy.init_node('doctor', anonymous=True)
            try:
                found += graph_findings(arguments)
            except KeyboardInterrupt:
                sys.exit('doctor: stopped')
            except NO_ANSWER as error:
                found.append(Finding('master', '', 'it ended while it was listened to (%s)' % error, 'start it again'))
    wrong = sum(finding.is_wrong for finding in found)
    for finding in found:
        print('\n'.join(finding.lines))
    print('doctor: %s' % ('all is well' if not wrong else '1 thing is wrong' if wrong == 1
                          else '%d things are wrong' % wrong))
    sys.stdout.flush()
    sys.exit(1 if wrong else 0)


def bag_findings(arguments):
    """Return the findings about a bag."""
    names = dict(remapping.split(':=') for remapping in sys.argv if ':=' in remapping)

    def name_of(topic):
        wanted = name_for(arguments.camera, topic)
        return '/' + names.get(wanted, wanted).lstrip('/')
    try:
        seen = observe_bag(arguments.bag, name_of, arguments.target_frame or 'map')
    except BagError as error:
        return [Finding('bag', '', str(error), 'rosbag info %s says what is in it' % arguments.bag)]
    return findings(seen)


def graph_findings(arguments):
    """Return the findings about the running graph.

    The graph is observed repeatedly until no fault is found or `arguments.patience` seconds have passed.

    Raises
    ------
    KeyboardInterrupt
        If the command is interrupted.
    `master.NO_ANSWER`
        If the master stops.
    """
    deadline_s = time.monotonic() + arguments.patience
    while True:
        cameras = tracked_cameras()
        camera = arguments.camera or cameras[0]
        look = GraphObserver(arguments.target_frame, camera)
        _sleep(arguments.seconds)
        found = findings(look.observations())
        look.close()
        if len(cameras) > 1:
            found.insert(0, Finding('cameras', '%s; of %s, looked at one by one: doctor --camera NAME'
                                    % (camera, ', '.join(cameras))))
        if not any(finding.is_wrong for finding in found) or time.monotonic() >= deadline_s:
            return found


def tracked_cameras():
    """Return the list of namespaces of the tracker's cameras; [''] for a single camera."""
    given = tracker_param('cameras')
    if not given:
        return ['']
    try:
        tracker, = params_from({'cameras': given}, TrackerNodeParams)
        return [str(camera) for camera in tracker.cameras] or ['']
    except ValueError:  # reported by the tracker itself
        return ['']


def _sleep(seconds):
    """Sleep in wall-clock time. Raises KeyboardInterrupt on Ctrl-C, because rospy handles the signal itself."""
    until_s = time.monotonic() + seconds
    while time.monotonic() < until_s:
        time.sleep(0.05)
        if rospy.core.is_shutdown_requested() or rospy.is_shutdown():
            raise KeyboardInterrupt


def machine_findings():
    """Check that a master is running and that other machines can reach this one by its host name."""
    uri = os.environ.get('ROS_MASTER_URI', '')
    fix = ('roscore, or roslaunch, starts one on this machine; of a robot: export ROS_MASTER_URI=http://ROBOT:11311')
    try:
        address = urlparse(uri)
        is_address = address.hostname and address.port
    except ValueError:  # the literal text http://HOST:PORT
        is_address = False
    if not is_address:
        return [Finding('master', '', 'ROS_MASTER_URI is %r; http://HOST:11311 expected' % uri, fix)]
    try:
        socket.create_connection((address.hostname, address.port), PATIENCE_S).close()
        patient_master().getPid()
    except socket.gaierror:
        return [Finding('master', '', 'this machine does not know the name %s in ROS_MASTER_URI' % address.hostname,
                        'export ROS_MASTER_URI with the address in numbers, or put the name into /etc/hosts')]
    except NO_ANSWER as error:
        reason = getattr(error, 'strerror', None) or error
        return [Finding('master', '', 'no ROS master answers at %s (%s)' % (uri, reason), fix)]
    return [Finding('master', uri), _own_name(address.hostname)]


def _own_name(master_host):
    """Check the host name under which other machines connect to this one."""
    name = rosgraph.network.get_host_name()
    try:
        socket.getaddrinfo(name, None)
    except socket.gaierror:
        return Finding('this machine', '', 'it calls itself %s, a name that it does not know itself' % name,
                       'export ROS_IP with the address by which the others reach it, or put the name into /etc/hosts')
    if name in LOCAL and master_host not in LOCAL:
        return Finding('this machine', '', 'it calls itself %s, and the master is on %s: nobody there can reach it'
                       % (name, master_host), 'export ROS_IP with the address by which the others reach it, and start '
                       'the nodes here again')
    return Finding('this machine', 'calls itself %s' % name)


def _parser():
    parser = argparse.ArgumentParser(
        prog='doctor', description='Say what keeps a running pipeline, or a bag, from working, and the fix of each. '
        'Topics with other names are given as remappings: camera/color/image_raw:=/front/color/image_raw')
    parser.add_argument('bag', nargs='?', help='a bag; without one the running graph is listened to')
    parser.add_argument('--seconds', type=float, default=5.0, metavar='S', help='how long to listen (default: 5)')
    parser.add_argument('--patience', type=float, default=0.0, metavar='S',
                        help='listen again for so long while something is wrong: nodes may be starting (default: 0)')
    parser.add_argument('--camera', default='', metavar='NAME',
                        help='namespace of the one of several cameras to look at (default: of a graph the first of '
                        "tracker_node's, of a bag none)")
    parser.add_argument('--target-frame', default='', metavar='FRAME',
                        help="fixed frame of the tracks (default: tracker_node's, of a bag map)")
    return parser
