"""Start-up of a node: read its parameters, create it, and report errors."""
import sys

import rospy

from ros_3d_bb.core.params import params_from
from ros_3d_bb.nodes.common.allocator import reuse_freed_memory
from ros_3d_bb.nodes.common.master_registration import Registration


def read_params(*kinds):
    """Read the node's private parameters as instances of NamedTuple types. Raises ValueError, see `params_from`."""
    return params_from(rospy.get_param('~', {}), *kinds)


def run_node(name, node_class, run=lambda _node: rospy.spin()):
    """Create a node, `run` it (by default until ROS shuts down) and return it.

    A ValueError of the constructor is a configuration error: it is logged, and the exit status is 1.
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
