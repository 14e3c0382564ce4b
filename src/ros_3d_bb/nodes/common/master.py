"""Requests to the ROS master with a timeout, for use when its machine may have left the network.

Requests of rospy block until the TCP timeout (minutes) and block all other requests of the process meanwhile.
"""
import http.client
import xmlrpc.client

import rospy
from rosgraph.masterapi import Master, MasterException
from rospy.impl.paramserver import get_param_server_cache

PATIENCE_S = 2.0  # timeout of a connection or a response within one network
TOPICS_LEFT_OUT = '/rosout_disable_topics_generation'
# Exceptions raised if the master is unreachable.
NO_ANSWER = OSError, http.client.HTTPException, xmlrpc.client.Error, rospy.ROSException, MasterException


class _PatientTransport(xmlrpc.client.Transport):
    def make_connection(self, host):
        connection = super(_PatientTransport, self).make_connection(host)
        connection.timeout = PATIENCE_S
        return connection


def patient_master():
    """Return a rosgraph Master with a separate connection, for use in one thread.

    Its methods raise MasterError if the master rejects the request, and another exception of `NO_ANSWER` if it does
    not respond in time.
    """
    master = Master(rospy.get_name())
    master.handle = xmlrpc.client.ServerProxy(master.master_uri, transport=_PatientTransport())
    return master


def log_without_asking():
    """Let rospy write log lines without a request to the master.

    If the parameter is not set, rospy requests it for each log line, and each logging thread waits for the response.
    """
    left_out = rospy.get_param_cached(TOPICS_LEFT_OUT, False)  # also subscribes to changes of the parameter
    get_param_server_cache().set(TOPICS_LEFT_OUT, left_out)
