"""Nodes as parts of one process."""
from typing import Any, Callable, NamedTuple, Optional

import rospy


class Part(NamedTuple):
    """How a node is part of its process: alone by default, or beside the others in people_node.

    Parameters, services and diagnostics have the names of a node of its own, whose private namespace is `namespace`.
    `transforms` are shared; None: the node has its own. `next_stage` is called with each result after it is published.
    `subscribes` states whether the node subscribes to the results of the stage before, and `monitors` whether its
    diagnostics report on the inputs and subscribers of the process.
    """

    namespace: str = '~'
    transforms: Any = None
    next_stage: Optional[Callable] = None
    subscribes: bool = True
    monitors: bool = True

    @property
    def node_name(self):
        """Global name of the node, which for a part in people_node is not that of the process."""
        return rospy.get_name() if self.namespace == '~' else rospy.resolve_name(self.namespace.rstrip('/'))
