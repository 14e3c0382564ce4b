"""Which nodes send the messages on a topic."""
from typing import Any, Set, Tuple


class Senders(object):
    """Nodes that send messages on a topic, or transforms of a frame.

    Several nodes send at once if one of them sends again after another one. A node that was restarted under another
    name, such as the player of a bag, only follows the former one.
    """

    def __init__(self) -> None:
        self._latest, self._alternate = '', False
        self._nodes: Set[str] = set()

    def add(self, node: str) -> None:
        if node != self._latest:
            self._alternate = self._alternate or node in self._nodes
            self._nodes.add(node)
            self._latest = node

    def take(self) -> Tuple[str, ...]:
        """Names of the nodes that have sent at once since the last call; empty if only one sent at a time."""
        found = tuple(sorted(self._nodes)) if self._alternate else ()
        self._nodes, self._alternate = {self._latest}, False
        return found


def sender_of(message: Any) -> str:
    """Name of the node that has sent a received message; empty for a message of a bag."""
    return getattr(message, '_connection_header', {}).get('callerid', '')
