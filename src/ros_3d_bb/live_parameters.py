"""Parameters that may be changed while a node runs: which, within what limits, and what they mean.

The file in config/ says it, in the comment above each parameter: it ends with `Live: 0 to 10.` (a number between
those), `Live: id, status, thesis.` (one of these words) or `Live.` (a switch or free text); other parameters are read
at the start only. A line `# --- title` begins a section. The types are those of the node's NamedTuples. The limits are
how far sliders go; whether a value makes sense is for the node to say, at its start and later.
"""
import re
from typing import NamedTuple, Optional

TYPES = {bool: 'bool', int: 'int', float: 'double', str: 'str', list: 'str'}  # the protocol knows no lists


class Parameter(NamedTuple):
    """One parameter of a file in config/. `live` is what its comment says after that word: '' where nothing, None
    where the parameter is read at the start only."""

    name: str
    section: str
    description: str
    live: Optional[str]


class Description(NamedTuple):
    """Live parameters as `dynamic_reconfigure.encoding.encode_description` takes them: groups, and values by name."""

    config_description: dict
    min: dict
    max: dict
    defaults: dict


def parameters_in(text):
    """The parameters of a file in config/, in its order. Returns a list of Parameter."""
    section, comment, found = '', [], []
    for line in text.splitlines():
        if line.startswith('# --- '):
            section = line[len('# --- '):].split(' (')[0]
        elif line.startswith('#'):
            comment.append(line[1:].strip())
        elif ':' in line:
            found.append(_parameter(line.split(':')[0], section, ' '.join(comment)))
            comment = []
        else:
            comment = []  # that was about the file
    return found


def _parameter(name, section, comment):
    live = re.search(r' Live(?:: (.+))?\.$', comment)
    if live is None:
        return Parameter(name, section, comment, None)
    return Parameter(name, section, comment[:live.start()], live.group(1) or '')


def description_of(parameters, kinds):
    """Describe live parameters for those who change them.

    Parameters
    ----------
    parameters : list of Parameter
        All live.
    kinds : sequence of NamedTuple classes
        Which have them as fields.

    Returns
    -------
    Description
        A group for each section.
    """
    types = {name: kind.__annotations__[name] for kind in kinds for name in kind._fields}
    limits = {each.name: _limits(each.live, types[each.name]) for each in parameters}
    groups = [_group(0, 'Default', '', parameters, types)]
    for section in sorted(set(each.section for each in parameters) - {''}):
        groups.append(_group(len(groups), section, section, parameters, types))
    values = plain_values(kind() for kind in kinds)
    return Description(dict(groups[0], groups=groups[1:]), {name: low for name, (low, _high) in limits.items()},
                       {name: high for name, (_low, high) in limits.items()}, {name: values[name] for name in limits})


def plain_values(params):
    """Values by name of NamedTuples, as the protocol knows them: lists are text with commas."""
    return {name: ', '.join(map(str, value)) if isinstance(value, (list, tuple)) else value
            for each in params for name, value in each._asdict().items()}


def _limits(live, kind):
    """The least and the largest value; texts have none."""
    if kind is bool:
        return False, True
    return tuple(kind(limit) for limit in live.split(' to ')) if kind in (int, float) else ('', '')


def _group(number, title, section, parameters, types):
    return {'name': title, 'type': '', 'state': True, 'id': number, 'parent': 0, 'groups': [],
            'parameters': [{'name': each.name, 'type': TYPES[types[each.name]], 'level': 0, 'edit_method': _choice(each)
                            if types[each.name] is str else '', 'description': each.description}
                           for each in parameters if each.section == section]}


def _choice(parameter):
    """The words to choose from, as text of a Python dictionary: so it is in the protocol. Empty where any will do."""
    if not parameter.live:
        return ''
    words = [{'name': word, 'type': 'str', 'value': word, 'description': ''} for word in parameter.live.split(', ')]
    return repr({'enum': words, 'enum_description': parameter.description})
