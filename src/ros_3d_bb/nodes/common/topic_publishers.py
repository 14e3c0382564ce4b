"""Query the master for the types and publishers of topics, and test whether the publishers are reachable."""
import socket
from urllib.parse import urlparse

from rosgraph.masterapi import MasterError

from ros_3d_bb.diagnosis.observations import Publisher
from ros_3d_bb.nodes.common.master import PATIENCE_S, patient_master


def published_topics():
    """Return {name: type} of all published topics. Raises one of `master.NO_ANSWER` without a master."""
    return dict(patient_master().getPublishedTopics('/'))


def publishers_of(topic, is_connected):
    """Return the publishers of a topic, with the connection problem of each.

    Parameters
    ----------
    topic : str
    is_connected : bool
        Whether the subscriber is connected; if so, no problems are searched for.

    Returns
    -------
    tuple of Publisher

    Raises
    ------
    `master.NO_ANSWER`
        If the master does not respond.
    """
    master = patient_master()
    publishing, _subscribing, _services = master.getSystemState()
    nodes = sorted(node for name, names in publishing if name == topic for node in names)
    return tuple(Publisher(node, '' if is_connected else _problem_of(master, node)) for node in nodes)


def _problem_of(master, node):
    try:
        address = urlparse(master.lookupNode(node))
    except MasterError as error:
        return 'the master does not know where it is (%s)' % error
    try:
        socket.create_connection((address.hostname, address.port), PATIENCE_S).close()
    except socket.gaierror:
        return 'it calls its machine %s, a name that this machine does not know' % address.hostname
    except OSError as error:
        return 'it cannot be reached at %s:%s (%s)' % (address.hostname, address.port, error.strerror or error)
    return ''
