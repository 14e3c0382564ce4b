"""Requests to the ROS master with a timeout, and registration of this node with a restarted master.

Requests of rospy block until the TCP timeout (minutes) if the machine of the master has left the network, and block all
other requests of the process meanwhile.
"""
import contextlib
import http.client
import io
import socket
import threading
import time
import xmlrpc.client
from urllib.parse import urlparse

import rospy
from genpy.message import get_message_class
from rosgraph.masterapi import Master, MasterError, MasterException
from rosgraph.network import ROSHandshakeException, read_ros_handshake_header, write_ros_handshake_header
from rospy.impl.paramserver import get_param_server_cache
from rospy.impl.registration import get_service_manager, get_topic_manager

from ros_3d_bb.diagnosis.observations import Publisher

TIMEOUT_S = 2.0  # of a connection or a response within one network
CHECK_PERIOD_S = 1.0
HEADER_BYTES = 2 ** 16  # read at once from a publisher
REACH_FIX = ('set ROS_IP on both machines to the address by which the other one reaches it (or add their names to '
             '/etc/hosts) and restart the nodes; if that node has ended: rosnode cleanup')
DISABLE_TOPICS = '/rosout_disable_topics_generation'
# Exceptions raised if the master is unreachable.
NO_ANSWER = OSError, http.client.HTTPException, xmlrpc.client.Error, rospy.ROSException, MasterException
_functions, _types = [], {}  # types and md5sums of publishers, by address of the node and topic


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
    """Return the type and md5sum with which a node publishes a topic."""
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


def on_new_master(function):
    """Register a function to be called after each registration with a new master.

    It is called in the thread of `Registration`, and called again if it or a later function raised an exception.
    """
    _functions.append(function)


class Registration(object):
    """Check once per second whether this node is registered with the master, and register it again if not.

    rospy does not do this. Connected nodes continue without a master and after its restart, because messages do not
    pass through it, but nodes that start later would not find them. The registration restores the topics, services and
    private parameters of the node, those of its `parts` (names of nodes), and /use_sim_time.
    """

    def __init__(self, parts=()):
        # rospy requests this parameter for each log line if it is not set; the logging thread would wait for a master.
        disable_topics = rospy.get_param_cached(DISABLE_TOPICS, False)  # also subscribes to changes of the parameter
        get_param_server_cache().set(DISABLE_TOPICS, disable_topics)
        self._master = patient_master()
        names = [rospy.get_name(), '/use_sim_time'] + [rospy.resolve_name(part) for part in parts]
        self._parameters = {name: rospy.get_param(name) for name in names if rospy.has_param(name)}
        self._is_reachable, self._is_registered = True, True
        threading.Thread(target=self._run, daemon=True).start()

    def _run(self):
        while not is_ending():
            time.sleep(CHECK_PERIOD_S)
            try:
                self._check()
            except Exception as error:  # OSError and those of rosgraph and xmlrpc; tried again in a second
                if self._is_reachable and not is_ending():
                    self._is_reachable = False
                    rospy.logwarn('the ROS master does not respond (%s): connected nodes continue, new connections '
                                  'are not possible; trying again every %.0f s', error, CHECK_PERIOD_S)

    def _check(self):
        if not self._is_known() and self._is_registered and not is_ending():
            rospy.logwarn('the ROS master was restarted; registering this node again')
            self._is_registered = False
        if not (self._is_registered or is_ending()):
            self._register()
            self._is_registered = True
        if not self._is_reachable:
            self._is_reachable = True
            rospy.loginfo('the ROS master responds again')

    def _is_known(self):
        """Whether the node's service is registered. The node name is no evidence: retried rospy calls register it."""
        try:
            self._master.lookupService(rospy.get_name() + '/get_loggers')  # registered only once, by init_node
            return True
        except MasterError:
            return False

    def _register(self):
        for name, value in self._parameters.items():
            if not self._master.hasParam(name):
                self._master.setParam(name, value)
        uri = rospy.get_node_uri()
        for topic, kind in get_topic_manager().get_publications():
            self._master.registerPublisher(topic, kind, uri)
        for topic, kind in get_topic_manager().get_subscriptions():
            publishers = self._master.registerSubscriber(topic, kind, uri)
            # as the master does for new publishers
            xmlrpc.client.ServerProxy(uri).publisherUpdate('/master', topic, publishers)
        for service, service_uri in get_service_manager().get_services():
            self._master.registerService(service, service_uri, uri)
        for function in _functions:
            function()
