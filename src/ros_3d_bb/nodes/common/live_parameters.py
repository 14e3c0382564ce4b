"""Convert the parameter table of a node (`params.Param`) to the dynamic_reconfigure protocol."""
from collections import OrderedDict
from typing import NamedTuple

from ros_3d_bb.core.params import table_of

TYPES = {bool: 'bool', int: 'int', float: 'double', str: 'str', tuple: 'str'}  # the protocol has no lists


class Description(NamedTuple):
    """Live parameters as expected by `dynamic_reconfigure.encoding.encode_description`: groups, and values by name."""

    config_description: dict
    min: dict
    max: dict
    defaults: dict


def live_in(kinds):
    """Return the live parameters of NamedTuple types, {name: Param}."""
    return OrderedDict((name, param) for name, param in table_of(kinds).items() if param.live)


def description_of(kinds):
    """Return the Description of the live parameters of NamedTuple types, with a group for each section."""
    live = live_in(kinds)
    groups = [_group(0, 'Default', '', live)]
    for section in sorted(set(param.section for param in live.values()) - {''}):
        groups.append(_group(len(groups), section, section, live))
    limits = {name: _slider(param) for name, param in live.items()}
    values = plain_values(kind() for kind in kinds)
    return Description(dict(groups[0], groups=groups[1:]), {name: low for name, (low, _high) in limits.items()},
                       {name: high for name, (_low, high) in limits.items()}, {name: values[name] for name in live})


def plain_values(params):
    """Return {name: value} of NamedTuples in the types of the protocol: lists become comma-separated text."""
    return {name: ', '.join(map(str, value)) if isinstance(value, (list, tuple)) else value
            for each in params for name, value in each._asdict().items()}


def _slider(param):
    """Return the minimum and maximum of a parameter; empty strings for text."""
    kind = type(param.default)
    if kind is bool:
        return False, True
    return (kind(param.live[0]), kind(param.live[1])) if kind in (int, float) else ('', '')


def _group(number, title, section, live):
    return {'name': title, 'type': '', 'state': True, 'id': number, 'parent': 0, 'groups': [],
            'parameters': [{'name': name, 'type': TYPES[type(param.default)], 'level': 0, 'edit_method': _choice(param),
                            'description': param.text + ' ' + param.facts}
                           for name, param in live.items() if param.section == section]}


def _choice(param):
    """Return the choices as the text of a Python dictionary, as the protocol requires; empty without choices."""
    if not param.choices or not isinstance(param.default, str):
        return ''
    words = [{'name': word, 'type': 'str', 'value': word, 'description': ''} for word in param.choices]
    return repr({'enum': words, 'enum_description': param.text})
