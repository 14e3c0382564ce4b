"""Bare rospy nodes for the latency benchmark, which exchange the same messages as another node and do nothing else.

Their CPU usage is the lower limit for that node: no rospy node with these topics needs less.
"""
import argparse
import socket
import threading
import time
from xmlrpc.client import ServerProxy

import rospy
from rosgraph.network import write_ros_handshake_header
from roslib.message import get_message_class
from sensor_msgs.msg import Image

from ros_3d_bb.nodes.common.master import patient_master
from ros_3d_bb.nodes.common.startup import reuse_freed_memory
from ros_3d_bb.nodes.common.subscribers import AT_ONCE, IMAGE_BUFFER, SMALL_BUFFER
from ros_3d_bb_lab.evaluation.latency.latency_probe_node import OUTPUTS

PREFIX = '/limit'  # of the topics that a limit publishes
NOT_MEASURED = '/rosout', '/clock', '/diagnostics'
RECONFIGURE = '/parameter_descriptions', '/parameter_updates'  # of dynamic_reconfigure
SETTLING_S = 1.0  # until the limits of all nodes have subscribed
POLL_S = 0.5
RECEIVED_BYTES = 2 ** 16


def topics_of(node, state):
    """Return the names of the topics that a node subscribes and publishes, {topic: number of other subscribers}.

    `state` is that of `getSystemState` of the master. Topics of diagnostics and dynamic_reconfigure are left out.
    """
    published, subscribed, _services = state
    audience = {topic: len(set(nodes) - {node}) for topic, nodes in subscribed}

    def of_node(entries):
        return {topic: audience.get(topic, 0) for topic, nodes in entries
                if node in nodes and topic not in NOT_MEASURED and not topic.endswith(RECONFIGURE)}
    return of_node(subscribed), of_node(published)


class Limit(object):
    """Subscribes to the topics of a node as the node does, and publishes one message of each topic of the node that has
    subscribers, whenever a message arrives on the `trigger`, one of the subscribed topics.

    The messages were published by the node; the topics have the `PREFIX`, and `Audience` provides as many subscribers
    as the node has.
    """

    def __init__(self, node, trigger):
        self._node, self._trigger = rospy.resolve_name(node), rospy.resolve_name(trigger)
        self._results = []  # (publisher, message)

    def start(self):
        """Subscribe and advertise, once the whole pipeline is working."""
        rospy.wait_for_message(OUTPUTS[-1][0], rospy.AnyMsg)
        kinds = {topic: get_message_class(kind) for topic, kind in patient_master().getTopicTypes()}
        subscribed, _published = topics_of(self._node, patient_master().getSystemState())
        for topic in subscribed:
            is_image, is_trigger = kinds[topic] is Image, topic == self._trigger
            rospy.Subscriber(topic, kinds[topic], self._publish if is_trigger else _discard, queue_size=AT_ONCE,
                             tcp_nodelay=True, buff_size=IMAGE_BUFFER if is_image else SMALL_BUFFER)
        time.sleep(SETTLING_S)
        _subscribed, published = topics_of(self._node, patient_master().getSystemState())
        for topic in [topic for topic, audience in published.items() if audience]:
            message = rospy.wait_for_message(topic, kinds[topic])
            self._results.append((rospy.Publisher(PREFIX + topic, kinds[topic], queue_size=10), message))

    def _publish(self, _message):
        for publisher, message in list(self._results):
            publisher.publish(message)


def _discard(_message):
    pass


class Audience(object):
    """Connects to the topics of all limits as often as subscribers are connected to the real topics.

    rospy shares one connection between the subscribers of a process, so the connections are made here.
    """

    def __init__(self):
        self._connected = set()

    def run(self):
        """Connect to new topics until ROS shuts down."""
        while not rospy.is_shutdown():
            master = patient_master()
            published, subscribed, _services = master.getSystemState()
            subscribers = {topic: len(nodes) for topic, nodes in subscribed}
            for topic, nodes in published:
                if topic.startswith(PREFIX + '/') and topic not in self._connected:
                    self._connected.add(topic)
                    uri = master.lookupNode(nodes[0])
                    for number in range(subscribers.get(topic[len(PREFIX):], 0)):
                        connection = connect(uri, topic, '%s_%d' % (rospy.get_name(), number))
                        threading.Thread(target=_receive, args=(connection,), daemon=True).start()
            time.sleep(POLL_S)


def connect(uri, topic, name):
    """Subscribe to a topic of the node with this URI as the node `name`. Returns the socket."""
    _code, _text, (_protocol, host, port) = ServerProxy(uri).requestTopic(name, topic, [['TCPROS']])
    connection = socket.create_connection((host, port))
    write_ros_handshake_header(connection, {'callerid': name, 'topic': topic, 'type': '*', 'md5sum': '*',
                                            'tcp_nodelay': '1'})
    return connection


def _receive(connection):
    """Discard the data of a connection until it is closed."""
    while connection.recv(RECEIVED_BYTES):
        pass


def main():
    """Run a `Limit` of a node; without a node, run the `Audience` of all limits."""
    parser = argparse.ArgumentParser(prog='rospy_limit', description=__doc__)
    parser.add_argument('node', nargs='?', help='node whose topics are subscribed; default: subscribe those of limits')
    parser.add_argument('trigger', nargs='?', help='topic whose messages are answered with the results of the node')
    arguments = parser.parse_args(rospy.myargv()[1:])
    reuse_freed_memory()
    rospy.init_node('rospy_limit')
    if arguments.node:
        Limit(arguments.node, arguments.trigger).start()
        rospy.spin()
    else:
        Audience().run()
