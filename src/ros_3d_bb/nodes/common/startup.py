"""What every node does first: read its parameters, or say why it cannot start."""
import sys

import rospy

from ros_3d_bb.core.params import params_from
from ros_3d_bb.nodes.common.allocator import reuse_freed_memory
from ros_3d_bb.nodes.common.master_registration import Registration


def read_params(*kinds):
    """The node's private parameters as instances of NamedTuple types. Raises ValueError, see `params_from`."""
    return params_from(rospy.get_param('~', {}), *kinds)


def run_node(name, node_class, run=lambda _node: rospy.spin()):
    """Make a node and `run` it, by default until ROS shuts down; return it.

    A ValueError at its start is a fault of the set-up: it is said, and the exit status is 1.
    """
    reuse_freed_memory()
    rospy.init_node(name)
    Registration()
    try:
        node = node_class()
    except ValueError as error:
        rospy.logfatal('%s cannot start: %s', rospy.get_name(), error)
        sys.exit(1)
    run(node)
    return node
