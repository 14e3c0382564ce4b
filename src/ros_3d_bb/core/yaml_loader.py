"""Read YAML that somebody else may have written: data only, and no more of it than is in the file.

An alias (`*name`) repeats what an anchor named; a few lines of them can stand for more than any memory holds, as soon
as somebody writes them out. None of our files needs one.
"""
import yaml


class _Loader(yaml.SafeLoader):
    """SafeLoader, which makes plain data only, without aliases."""

    def compose_node(self, parent, index):
        if self.check_event(yaml.AliasEvent):
            event = self.peek_event()
            raise yaml.YAMLError('the alias *%.40s %s; write it out' % (event.anchor, event.start_mark))
        return super(_Loader, self).compose_node(parent, index)


def load_yaml(stream):
    """The content of a stream of YAML.

    Raises
    ------
    yaml.YAMLError
        If it is none, has aliases or tags of objects, or is nested too deeply.
    """
    try:
        return yaml.load(stream, Loader=_Loader)
    except yaml.YAMLError:
        raise
    except RecursionError:
        raise yaml.YAMLError('it is nested too deeply')
    except (ValueError, OverflowError) as error:  # no text, a day that no month has, a number of too many digits
        raise yaml.YAMLError(str(error))
