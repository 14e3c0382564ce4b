"""Safe loading of untrusted YAML: plain data only, without aliases.

Nested aliases (`*name`) let a few lines expand to more data than fits into memory ("billion laughs"). None of the
files of this package needs them.
"""
from typing import Any, IO, Union

import yaml


class _Loader(yaml.SafeLoader):
    """SafeLoader that rejects aliases."""

    def compose_node(self, parent: Any, index: Any) -> Any:
        if self.check_event(yaml.AliasEvent):
            event = self.peek_event()
            raise yaml.YAMLError('the alias *%.40s %s; write it out' % (event.anchor, event.start_mark))
        return super(_Loader, self).compose_node(parent, index)


def load_yaml(stream: Union[str, bytes, IO[Any]]) -> Any:
    """Load one YAML document from a stream. Raises yaml.YAMLError also for aliases, object tags and deep nesting."""
    try:
        return yaml.load(stream, Loader=_Loader)
    except RecursionError:
        raise yaml.YAMLError('it is nested too deeply')
    except (ValueError, OverflowError) as error:  # not text, an impossible date, a number with too many digits
        raise yaml.YAMLError(str(error))
