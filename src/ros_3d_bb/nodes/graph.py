"""What the master knows of a topic: who publishes it, with what type; and whether those can be reached."""
import http.client
import socket
import xmlrpc.client
from urllib.parse import urlparse

import rospy

from ros_3d_bb.diagnosis.seen import Publisher

PATIENCE_S = 2.0  # for a connection within one network
NO_ANSWER = OSError, http.client.HTTPException, xmlrpc.client.Error, rospy.ROSException  # of a master that is not there


def published_topics():
    """{name: type} of all topics that somebody publishes. Raises one of `NO_ANSWER` without a master."""
    return dict(rospy.get_published_topics())


def publishers_of(topic, is_connected):
    """Who publishes a topic, a tuple of Publisher; of those that send nothing here, what keeps them from it.

    Raises one of `NO_ANSWER` without a master.
    """
    master = rospy.get_master()
    _code, _text, (publishing, _subscribing, _services) = master.getSystemState()
    nodes = sorted(node for name, names in publishing if name == topic for node in names)
    return tuple(Publisher(node, '' if is_connected else _problem_of(master, node)) for node in nodes)


def _problem_of(master, node):
    code, text, uri = master.lookupNode(node)
    if code != 1:
        return 'the master does not know where it is (%s)' % text
    address = urlparse(uri)
    try:
        socket.create_connection((address.hostname, address.port), PATIENCE_S).close()
    except socket.gaierror:
        return 'it calls its machine %s, a name that this machine does not know' % address.hostname
    except OSError as error:
        return 'it cannot be reached at %s:%s (%s)' % (address.hostname, address.port, error.strerror or error)
    return ''
