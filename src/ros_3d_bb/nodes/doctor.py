"""Command `doctor`: find the faults of a running pipeline or of a bag, and suggest a fix for each."""
import argparse
import os
import socket
import sys
import threading
import time
from urllib.parse import urlparse

import rosgraph
import rospy

from ros_3d_bb.bags.bag_reader import BagError
from ros_3d_bb.conversions.camera_msgs import DEPTH_TOPICS, absolute
from ros_3d_bb.diagnosis.checks import findings
from ros_3d_bb.diagnosis.message_observer import observe_bag
from ros_3d_bb.diagnosis.next_command import DEFAULT_TARGET, next_command
from ros_3d_bb.diagnosis.observations import Finding
from ros_3d_bb.nodes.common.graph_observer import GraphObserver, name_for, tracker_param
from ros_3d_bb.nodes.common.master import NO_ANSWER, TIMEOUT_S, patient_master

LOCAL = 'localhost', '127.0.0.1', '127.0.1.1', '::1'
EXPORT_IP = 'export ROS_IP with the address by which other machines reach this one, '


def main():
    """Run the command. The exit status is 0 if no fault is found and 1 otherwise."""
    arguments = _parser().parse_args(rospy.myargv()[1:])
    command = purpose = ''
    if arguments.bag:
        found, command, purpose = bag_findings(arguments)
    else:
        found = machine_findings()
        if not any(finding.fault for finding in found):
            rospy.init_node('doctor', anonymous=True)
            try:
                found += graph_findings(arguments)
            except KeyboardInterrupt:
                sys.exit('doctor: stopped')
            except NO_ANSWER as error:
                found.append(Finding('master', '', 'it stopped during the checks (%s)' % error, 'restart it'))
    for finding in found:
        print('\n'.join(finding.lines))
    faults = sum(1 for finding in found if finding.fault)
    print('doctor: %s' % {0: 'no faults found', 1: '1 fault found'}.get(faults, '%d faults found' % faults))
    if command:
        print('next: %s\n      %s' % (command, purpose))
    sys.stdout.flush()
    sys.exit(1 if faults else 0)


def bag_findings(arguments):
    """Return the findings about a bag, the next command, and what it does; empty if there is none."""
    names = dict(remapping.lstrip('/').split(':=') for remapping in sys.argv if ':=' in remapping)

    def name_of(topic):
        wanted = name_for(arguments.camera, topic)
        return absolute(names.get(wanted, wanted))
    try:
        seen = observe_bag(arguments.bag, name_of, arguments.target_frame or DEFAULT_TARGET, arguments.depth)
    except BagError as error:
        return [Finding('bag', '', str(error), 'rosbag info %s lists its content' % arguments.bag)], '', ''
    found = findings(seen)
    return (found,) + next_command(arguments.bag, seen, found)


def graph_findings(arguments):
    """Return the findings about the running graph. Raises one of `NO_ANSWER` if the master stops.

    The graph is observed repeatedly until no fault is found or `arguments.patience` seconds have passed.
    """
    deadline_s = time.monotonic() + arguments.patience
    shutdown = threading.Event()
    rospy.on_shutdown(shutdown.set)  # on Ctrl-C, because rospy handles the signal itself
    while True:
        camera_names = [str(name) for name in tracker_param('cameras')] or ['']  # '': a single one
        camera_name = arguments.camera or camera_names[0]
        observer = GraphObserver(arguments.target_frame, camera_name)
        if shutdown.wait(arguments.seconds):
            raise KeyboardInterrupt
        seen = observer.observations()
        found = _namespace_findings(seen.nodes) or findings(seen)  # findings of another namespace would mislead
        observer.close()
        if len(camera_names) > 1:
            found.insert(0, Finding('cameras', '%s; of %s, checked one at a time: doctor --camera NAME'
                                    % (camera_name, ', '.join(camera_names))))
        if not any(finding.fault for finding in found) or time.monotonic() >= deadline_s:
            return found


def _namespace_findings(nodes):
    """Report a pipeline that runs in other namespaces only; `nodes` are the names in diagnostics."""
    own = rospy.resolve_name('tracker_node')[1:]
    others = sorted(name[:-len('/tracker_node')] for name in nodes if name.endswith('/tracker_node'))
    if own in nodes or not others:
        return []
    return [Finding('namespace', '', 'tracker_node runs in %s' % ', '.join(others),
                    'ROS_NAMESPACE=%s rosrun ros_3d_bb doctor' % others[0])]


def machine_findings():
    """Check that a master is running and that other machines can reach this one by its host name."""
    uri = os.environ.get('ROS_MASTER_URI', '')
    fix = 'start one on this machine with roscore or roslaunch; on a robot: export ROS_MASTER_URI=http://ROBOT:11311'
    try:
        address = urlparse(uri)
        is_address = address.hostname and address.port
    except ValueError:  # the literal text http://HOST:PORT
        is_address = False
    if not is_address:
        return [Finding('master', '', 'ROS_MASTER_URI is %r; http://HOST:11311 expected' % uri, fix)]
    try:
        socket.create_connection((address.hostname, address.port), TIMEOUT_S).close()
        patient_master().getPid()
    except socket.gaierror:
        return [Finding('master', '', 'this machine cannot resolve the name %s in ROS_MASTER_URI' % address.hostname,
                        'export ROS_MASTER_URI with the IP address, or add the name to /etc/hosts')]
    except NO_ANSWER as error:
        reason = getattr(error, 'strerror', None) or error
        return [Finding('master', '', 'no ROS master responds at %s (%s)' % (uri, reason), fix)]
    return [Finding('master', uri), _own_name(address.hostname)]


def _own_name(master_host):
    """Check the host name under which other machines connect to this one."""
    name = rosgraph.network.get_host_name()
    try:
        socket.getaddrinfo(name, None)
    except socket.gaierror:
        return Finding('this machine', '', 'it cannot resolve its own host name %s' % name,
                       EXPORT_IP + 'or add the name to /etc/hosts')
    if name in LOCAL and master_host not in LOCAL:
        return Finding('this machine', '', 'its host name is %s, and the master is on %s: other machines cannot reach '
                       'its nodes' % (name, master_host), EXPORT_IP + 'and restart the nodes here')
    return Finding('this machine', 'its host name is %s' % name)


def _parser():
    parser = argparse.ArgumentParser(
        prog='doctor', description='Find the faults of a running pipeline, or of a bag, and print the fix of each. '
        'Topics with other names are given as remappings: camera/color/image_raw:=/front/color/image_raw')
    parser.add_argument('bag', nargs='?', help='a bag; without it, the running graph is checked')
    parser.add_argument('--seconds', type=float, default=5.0, metavar='S', help='duration of a check (default: 5)')
    parser.add_argument('--patience', type=float, default=0.0, metavar='S',
                        help='repeat the checks for this time while there are faults (default: 0)')
    parser.add_argument('--camera', default='', metavar='NAME',
                        help='namespace of the camera (default: the first one of tracker_node; none for a bag)')
    parser.add_argument('--depth', choices=DEPTH_TOPICS, default='aligned', help='for a bag: raw if its depth images '
                        'are not aligned to colour and are to be registered (default: aligned; in a graph, that of '
                        'bbox3d_node)')
    parser.add_argument('--target-frame', default='', metavar='FRAME',
                        help='fixed frame of the tracks (default: that of tracker_node; map for a bag)')
    return parser
