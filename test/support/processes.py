"""Processes of nodes, to be killed and stopped, and processes that disturb them."""
import contextlib
import glob
import os
import signal
import socket
import subprocess
import sys
import time
from xmlrpc.client import ServerProxy

import rospy
from rosgraph.network import write_ros_handshake_header

from ros_3d_bb_lab.evaluation.latency.latency_probe_node import pid_of
from support.ros import TIMEOUT_S, wait_until

BUSY_LOOP = 'import os\nparent = os.getppid()\nwhile os.getppid() == parent:\n    pass'


@contextlib.contextmanager
def cpu_load(cores):
    """Other processes load some cores within the block. They end with this process in any case."""
    processes = [subprocess.Popen([sys.executable, '-c', BUSY_LOOP]) for _core in range(cores)]
    try:
        yield
    finally:
        for process in processes:
            process.kill()
            process.wait()


def processes_naming(text):
    found = 0
    for path in glob.glob('/proc/[0-9]*/cmdline'):
        with contextlib.suppress(OSError), open(path) as stream:  # a process may have ended
            found += text in stream.read()
    return found


def killed_and_back(node, meanwhile):
    """Kill a node and call `meanwhile` until it is restarted; returns the elapsed seconds."""
    pid, began_s = pid_of(node), time.monotonic()
    os.kill(pid, signal.SIGKILL)
    while pid_of(node) in (None, pid):
        assert time.monotonic() - began_s < TIMEOUT_S, '%s was not restarted' % node
        meanwhile()
    return time.monotonic() - began_s


@contextlib.contextmanager
def hanging(node):
    pid = pid_of(node)
    os.kill(pid, signal.SIGSTOP)
    try:
        yield
    finally:
        os.kill(pid, signal.SIGCONT)


@contextlib.contextmanager
def never_reading(node, topic):
    """A node has a subscriber that never reads from its connection."""
    uri = rospy.get_master().lookupNode(node)[2]
    _code, _text, (_protocol, *address) = ServerProxy(uri).requestTopic('/subscriber', topic, [['TCPROS']])
    with contextlib.closing(socket.create_connection(address)) as connection:
        write_ros_handshake_header(connection, {'callerid': '/subscriber', 'topic': topic, 'type': '*', 'md5sum': '*'})
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        wait_until(lambda: any(entry[1] == '/subscriber' and entry[4] == topic for entry in ServerProxy(uri).getBusInfo(
            '/subscriber')[2]), 'the connection of a subscriber of ' + topic)
        yield
