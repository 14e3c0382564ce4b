"""Requests to the ROS master with a timeout.

Requests of rospy block until the TCP timeout (minutes) if the machine of the master has left the network, and block all
other requests of the process meanwhile.
"""
import contextlib
import http.client
import io
import socket
import xmlrpc.client
from urllib.parse import urlparse

import rospy
from genpy.message import get_message_class
from rosgraph.masterapi import Master, MasterError, MasterException
from rosgraph.network import ROSHandshakeException, read_ros_handshake_header, write_ros_handshake_header
from rospy.impl.paramserver import get_param_server_cache

from ros_3d_bb.diagnosis.observations import Publisher

TIMEOUT_S = 2.0  # of a connection or a response within one network
HEADER_BYTES = 2 ** 16  # read at once from a publisher
REACH_FIX = ('set ROS_IP on both machines to the address by which the other one reaches it (or add their names to '
             '/etc/hosts) and restart the nodes; if that node has ended: rosnode cleanup')
DISABLE_TOPICS = '/rosout_disable_topics_generation'
# Exceptions raised if the master is unreachable.
NO_ANSWER = OSError, http.client.HTTPException, xmlrpc.client.Error, rospy.ROSException, MasterException
_types = {}  # types and md5sums of publishers, by address of the node and topic


def is_ending():
    """Whether rospy is shutting down. rospy closes publishers during running callbacks before it sets is_shutdown."""
    return rospy.is_shutdown() or rospy.core.is_shutdown_requested()


class _Transport(xmlrpc.client.Transport):
    def make_connection(self, host):
        connection = super(_Transport, self).make_connection(host)
        connection.timeout = TIMEOUT_S
        return connection


def patient_master():
    """Return a rosgraph Master with a separate connection, for use in one thread.

    Its methods raise MasterError if the master rejects the request, another of `NO_ANSWER` if it does not respond.
    """
    master = Master(rospy.get_name())
    master.handle = xmlrpc.client.ServerProxy(master.master_uri, transport=_Transport())
    return master


def published_topics():
    """Return {name: type} of all published topics. Raises one of `NO_ANSWER` without a master."""
    return dict(patient_master().getPublishedTopics('/'))


def publishers_of(topic):
    """Return a tuple of `Publisher`: the publishers of a topic, with the connection problem of each.

    Problems are also searched for if a subscriber seems connected, as rospy 1.15 counts ended connections. Raises one
    of `NO_ANSWER` without a master.
    """
    master = patient_master()
    publishing, _subscribing, _services = master.getSystemState()
    nodes = sorted(node for name, names in publishing if name == topic for node in names)
    return tuple(Publisher(node, *_connection_problem(master, node, topic)) for node in nodes)


def _connection_problem(master, node, topic):
    """Return why a topic of a node cannot be received, and the fix; both empty if it can."""
    try:
        uri = master.lookupNode(node)
    except MasterError as error:
        return 'its address is not registered with the master (%s)' % error, REACH_FIX
    address = urlparse(uri)
    try:
        socket.create_connection((address.hostname, address.port), TIMEOUT_S).close()
    except socket.gaierror:
        return 'this machine cannot resolve its host name %s' % address.hostname, REACH_FIX
    except OSError as error:
        return ('it cannot be reached at %s:%s (%s)' % (address.hostname, address.port, error.strerror or error),
                REACH_FIX)
    if (uri, topic) not in _types:  # once, as a publisher that is silent keeps the connection
        with contextlib.suppress(ROSHandshakeException, TypeError, ValueError, KeyError, *NO_ANSWER):  # it is ending
            _types[uri, topic] = _published_type(uri, topic)
    return _type_problem(*_types.get((uri, topic), ('', '')))


def _published_type(uri, topic):
    node = xmlrpc.client.ServerProxy(uri, transport=_Transport())
    _code, _text, (_protocol, host, port) = node.requestTopic(rospy.get_name(), topic, [['TCPROS']])
    with contextlib.closing(socket.create_connection((host, port), TIMEOUT_S)) as connection:
        # under another name: rospy closes the former connection to a subscriber with the same one
        write_ros_handshake_header(connection, {'topic': topic, 'type': '*', 'md5sum': '*',
                                                'callerid': rospy.get_name() + '_type'})
        header = read_ros_handshake_header(connection, io.BytesIO(), HEADER_BYTES)
    return header['type'], header['md5sum']


def _type_problem(kind, md5sum):
    ours = get_message_class(kind) if kind else None
    if ours is None or ours._md5sum == md5sum:
        return '', ''
    return ('it has another version of %s (md5sum %s, here %s), which cannot be received'
            % (kind, md5sum, ours._md5sum),
            'build the same version of %s on all machines, and restart the nodes' % kind.partition('/')[0])


def cache_logging_parameter():
    """Cache a parameter that rospy requests for each log line if it is not set: logging does not wait for a master."""
    disable_topics = rospy.get_param_cached(DISABLE_TOPICS, False)  # also subscribes to changes of the parameter
    get_param_server_cache().set(DISABLE_TOPICS, disable_topics)
