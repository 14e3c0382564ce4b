"""Start-up of a node, alone or beside others: read its parameters, create it, report errors, wait for subscribers."""
import ctypes
import sys
import time
from typing import Any, Callable, NamedTuple, Optional

import rospy

from ros_3d_bb.core.params import params_from, with_places
from ros_3d_bb.nodes.common.master import cache_logging_parameter

# Launch arguments for the parameter files of nodes.
PARAMS_FILES = {'%s_node' % name: '%s_params' % name for name in (
    'bbox3d', 'camera_pose', 'detector', 'planner_bridge', 'realsense', 'tracker', 'viewer')}
PARAMS_FILES.update({'%s_node' % name: 'params' for name in ('follow', 'people_removal', 'speed_limit')})
# Parameters that have a launch argument of their own. Few users have a file for them.
ARGUMENTS = dict(detector='detector', weights='weights', scenario='scenario', window='window', frame_id='frame_id',
                 outputs='planner')
POLL_S = 0.05
SETTLING_S = 1.0  # a node that has connected to one topic may still be connecting to the others
SENDING_S = 1.0  # from the last message to the exit: rospy drops messages that it has not sent before the shutdown
LONGEST_WAIT_S = 60.0  # after this time, missing subscribers are an error
M_TRIM_THRESHOLD, M_MMAP_THRESHOLD, M_ARENA_MAX = -1, -3, -8  # glibc's malloc.h
LARGEST_BYTES = 32 * 2 ** 20  # limit of glibc


class Part(NamedTuple):
    """How a node is part of its process: alone by default, or beside the others in people_node.

    Parameters, services and diagnostics have the names of a node of its own, whose private namespace is `namespace`.
    `transforms` and `inputs`, an RgbdInputs, are shared; None: the node has its own. `next_stage` is called with each
    result after it is published, and what the next stage needs with it. `subscribes` states whether the node subscribes
    to the results of the stage before, and `monitors` whether its diagnostics report on the inputs of the process.
    """

    namespace: str = '~'
    transforms: Any = None
    inputs: Any = None
    next_stage: Optional[Callable] = None
    subscribes: bool = True
    monitors: bool = True

    @property
    def node_name(self):
        """Global name of the node, which for a part in people_node is not that of the process."""
        return rospy.get_name() if self.namespace == '~' else rospy.resolve_name(self.namespace.rstrip('/'))


def read_params(*kinds, namespace='~'):
    """Read the parameters of a node as instances of NamedTuple types. Raises ValueError, see `params_from`."""
    return params_from(stored_params(namespace), *kinds)


def stored_params(namespace='~'):
    """The parameters of a node on the parameter server, as a dict; by default those of the node of this process."""
    return rospy.get_param(namespace.rstrip('/'), {})


def launch_places(nodes):
    """Return a function that returns the launch argument which sets a parameter of some nodes, as text.

    It is empty for a name that is not on the parameter server: then the node was started without a launch file, or the
    name is that of a service. It is one of `ARGUMENTS`, or a file.
    """
    stored = {PARAMS_FILES[node]: stored_params(rospy.resolve_name(node)) for node in nodes if node in PARAMS_FILES}

    def place_of(name):
        if name in ARGUMENTS:
            return 'launch argument %s:=' % ARGUMENTS[name] if any(stored.values()) else ''
        files = sorted(argument for argument, params in stored.items() if name in params)
        return 'launch argument %s' % ' or '.join('%s:=FILE' % each for each in files) if files else ''
    return place_of


def run_node(name, node_class, run=lambda _node: rospy.spin(), parts=()):
    """Create a node (of `parts`, names of nodes, if any), `run` it (by default until ROS shuts down) and return it.

    A ValueError of the constructor is a configuration error: it is logged, and the exit status is 1.
    """
    reuse_freed_memory()
    rospy.init_node(name)
    cache_logging_parameter()
    try:
        node = node_class()
    except ValueError as error:
        rospy.logfatal('%s cannot start: %s', rospy.get_name(), with_places(str(error), launch_places(parts or [name])))
        sys.exit(1)
    run(node)
    return node


def wait_for_subscribers(publisher, wanted, meanwhile):
    """Call `meanwhile` until a publisher has `wanted` subscribers. Raises RuntimeError after LONGEST_WAIT_S."""
    began_s = time.monotonic()
    while publisher.get_num_connections() < wanted and not rospy.is_shutdown():
        if time.monotonic() - began_s > LONGEST_WAIT_S:
            raise RuntimeError('%s has %d subscribers after %.0f s; %d expected (~wait_for_subscribers)' % (
                publisher.resolved_name, publisher.get_num_connections(), LONGEST_WAIT_S, wanted))
        meanwhile()
        time.sleep(POLL_S)
    if wanted:
        time.sleep(SETTLING_S)


def reuse_freed_memory():
    """Let glibc reuse the memory of freed images. Returns whether the settings were applied; not by other C libraries.

    By default, glibc returns large blocks to the system and requests them again, and the kernel clears them page by
    page. For a rospy node this is two thirds of the cost of receiving an image. All threads share one heap, so the
    retained memory does not exceed the peak use: rospy starts one thread per connection, and with one heap per thread
    (glibc's default) the memory of a node would grow with each subscriber that connects and disconnects.
    """
    try:
        mallopt = ctypes.CDLL(None).mallopt
    except (AttributeError, OSError):
        return False
    return all([mallopt(M_MMAP_THRESHOLD, LARGEST_BYTES) == 1, mallopt(M_TRIM_THRESHOLD, 4 * LARGEST_BYTES) == 1,
                mallopt(M_ARENA_MAX, 1) == 1])
