"""Nodes as parts of one process."""
from typing import Any, Callable, NamedTuple, Optional


class Part(NamedTuple):
    """How a node is part of its process: alone by default, or beside the others in people_node.

    Parameters and services have the names of a node of its own, whose private namespace is `namespace`. `diagnostics`
    and `transforms` are shared; None: the node has its own. `next_stage` is called with each result after it is
    published. `subscribes` states whether the node subscribes to the results of the stage before.
    """

    namespace: str = '~'
    diagnostics: Any = None
    transforms: Any = None
    next_stage: Optional[Callable] = None
    subscribes: bool = True
