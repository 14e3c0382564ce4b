"""Nodes as processes, to be killed and stopped; and what else takes their cores or never reads what they send."""
import contextlib
import os
import signal
import socket
import struct
import subprocess
import sys
import time
from xmlrpc.client import Fault, ServerProxy

import rospy

from support.ros import TIMEOUT_S, wait_until

BUSY = 'while True: pass'


def pid_of(node):
    """The process of a node; None where it does not answer."""
    code, _said, uri = rospy.get_master().lookupNode(node)
    try:
        return ServerProxy(uri).getPid(rospy.get_name())[2] if code == 1 else None
    except (OSError, Fault):
        return None


def killed_and_back(node, meanwhile):
    """Kill a node and call `meanwhile` until it was started again; returns after how many seconds."""
    pid, began_s = pid_of(node), time.monotonic()
    os.kill(pid, signal.SIGKILL)
    while pid_of(node) in (None, pid):
        assert time.monotonic() - began_s < TIMEOUT_S, '%s was not started again' % node
        meanwhile()
    return time.monotonic() - began_s


@contextlib.contextmanager
def hanging(node):
    """A node does nothing within the block."""
    pid = pid_of(node)
    os.kill(pid, signal.SIGSTOP)
    try:
        yield
    finally:
        os.kill(pid, signal.SIGCONT)


@contextlib.contextmanager
def starved(at_once):
    """So many processes for each core want all of it."""
    busy = [subprocess.Popen([sys.executable, '-c', BUSY]) for _process in range(at_once * os.cpu_count())]
    try:
        yield
    finally:
        for process in busy:
            process.kill()
        for process in busy:
            process.wait()


@contextlib.contextmanager
def never_reading(node, topic, kind):
    """A subscriber of a node that takes nothing of what that sends."""
    uri = rospy.get_master().lookupNode(node)[2]
    _code, _said, (_protocol, host, port) = ServerProxy(uri).requestTopic('/deaf', topic, [['TCPROS']])
    with contextlib.closing(socket.socket()) as connection:
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        connection.connect((host, port))
        fields = ['callerid=/deaf', 'topic=' + topic, 'md5sum=' + kind._md5sum, 'type=' + kind._type]
        header = b''.join(struct.pack('<I', len(field)) + field.encode() for field in fields)
        connection.sendall(struct.pack('<I', len(header)) + header)
        wait_until(lambda: any(entry[1] == '/deaf' and entry[4] == topic for entry in ServerProxy(uri).getBusInfo(
            '/deaf')[2]), 'the connection of a subscriber of ' + topic)
        yield
