"""Questions to the ROS master that end, also where its machine has gone from the network.

rospy's own wait for as long as TCP does, minutes, and keep all others of this process waiting meanwhile.
"""
import http.client
import xmlrpc.client

import rospy
from rosgraph.masterapi import Master, MasterException
from rospy.impl.paramserver import get_param_server_cache

PATIENCE_S = 2.0  # for a connection, or an answer, within one network
TOPICS_LEFT_OUT = '/rosout_disable_topics_generation'
# of a master that is not there
NO_ANSWER = OSError, http.client.HTTPException, xmlrpc.client.Error, rospy.ROSException, MasterException


class _PatientTransport(xmlrpc.client.Transport):
    def make_connection(self, host):
        connection = super(_PatientTransport, self).make_connection(host)
        connection.timeout = PATIENCE_S
        return connection


def patient_master():
    """A rosgraph Master with a connection of its own, for one thread.

    Its calls raise MasterError where the master refuses, another of `NO_ANSWER` where it does not answer in time.
    """
    master = Master(rospy.get_name())
    master.handle = xmlrpc.client.ServerProxy(master.master_uri, transport=_PatientTransport())
    return master


def log_without_asking():
    """Have rospy write lines of the log without a question to the master.

    Where the parameter is not set it asks for it at each line, and each thread that logs waits for the answer.
    """
    left_out = rospy.get_param_cached(TOPICS_LEFT_OUT, False)  # subscribes it, too: rospy hears where that changes
    get_param_server_cache().set(TOPICS_LEFT_OUT, left_out)
