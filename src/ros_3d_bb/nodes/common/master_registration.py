"""Register the node again after a restart of the ROS master, which rospy does not do.

Connected nodes continue without a master and after its restart, because messages do not pass through it. A new master,
however, has no registrations and no parameters, so nodes that start later would not find the existing ones.
"""
import threading
import time
from xmlrpc.client import ServerProxy

import rospy
from rosgraph.masterapi import MasterError
from rospy.impl.registration import get_service_manager, get_topic_manager

from ros_3d_bb.nodes.common.diagnostics import is_ending
from ros_3d_bb.nodes.common.master import log_without_asking, patient_master

PERIOD_S = 1.0
_functions = []


def on_new_master(function):
    """Register a function to be called after each registration with a new master.

    It is called in the thread of `Registration`, and called again if it or a later function raised an exception.
    """
    _functions.append(function)


class Registration(object):
    """Check once per second whether this node is registered with the master, and register it again if not.

    The registration restores the topics, services and private parameters of the node, and /use_sim_time.
    """

    def __init__(self):
        log_without_asking()
        self._master = patient_master()
        self._parameters = {name: rospy.get_param(name) for name in (rospy.get_name(), '/use_sim_time')
                            if rospy.has_param(name)}
        self._is_away, self._is_registered = False, True
        thread = threading.Thread(target=self._run)
        thread.daemon = True
        thread.start()

    def _run(self):
        while not is_ending():
            time.sleep(PERIOD_S)
            try:
                self._look()
            except Exception as error:  # OSError and those of rosgraph and xmlrpc; tried again in a second
                self._say_away(error)

    def _look(self):
        if not self._is_known() and self._is_registered and not is_ending():
            rospy.logwarn('the ROS master knows this node no more: it was restarted; registering again')
            self._is_registered = False
        if not (self._is_registered or is_ending()):
            self._register()
            self._is_registered = True
        if self._is_away:
            self._is_away = False
            rospy.loginfo('the ROS master answers again')

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
            ServerProxy(uri).publisherUpdate('/master', topic, publishers)  # as the master does for new publishers
        for service, service_uri in get_service_manager().get_services():
            self._master.registerService(service, service_uri, uri)
        for function in _functions:
            function()

    def _say_away(self, error):
        if not (self._is_away or is_ending()):
            self._is_away = True
            rospy.logwarn('the ROS master does not answer (%s): nodes that are connected go on, others do not find '
                          'each other; looking for it every %.0f s', error, PERIOD_S)
