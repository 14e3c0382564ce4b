"""Registering again with a ROS master that was restarted, as rospy itself does not do.

Nodes that are connected go on without a master, and after its restart: messages do not pass through it. But a new
master knows nobody, so whoever comes later would find nothing, and has lost all parameters.
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
    """Have a function called after each registration with a new master, in the thread that does it; again where it, or
    one after it, raised an exception.
    """
    _functions.append(function)


class Registration(object):
    """Looks once a second whether the master still knows this node, and registers it again where it does not.

    Its topics, services and private parameters, and /use_sim_time, are then as before.
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
            except Exception as error:  # OSError and all that rosgraph and xmlrpc raise: the next second may be better
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
        """Not whether it knows the node, as it does after the first call that rospy itself tried again."""
        try:
            self._master.lookupService(rospy.get_name() + '/get_loggers')  # registered by init_node, and never again
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
            ServerProxy(uri).publisherUpdate('/master', topic, publishers)  # what the master does when more come
        for service, service_uri in get_service_manager().get_services():
            self._master.registerService(service, service_uri, uri)
        for function in _functions:
            function()

    def _say_away(self, error):
        if not (self._is_away or is_ending()):
            self._is_away = True
            rospy.logwarn('the ROS master does not answer (%s): nodes that are connected go on, others do not find '
                          'each other; looking for it every %.0f s', error, PERIOD_S)
