"""Records in YAML files: NamedTuples whose fields are numbers, texts, lists of numbers and other records."""
import math
from typing import Any

import yaml

from ros_3d_bb.core.params import nearest_name

EXPECTED = {float: 'a number', int: 'an integer', str: 'text'}  # types of values


def record_from(kind: Any, content: Any, where: str = '') -> Any:
    """Convert YAML content to a NamedTuple `kind`; `where` is its key.

    Raises ValueError if a key is unknown (the message names the nearest one), missing, or has an invalid value.
    """
    if not isinstance(content, dict):
        raise ValueError('%s is %.50r; the keys %s expected' % (where or 'it', content, ', '.join(kind._fields)))
    prefix = where + '.' if where else ''
    for name in content:
        if name not in kind._fields:
            raise ValueError('unknown key %s%s; did you mean %s%s?'
                             % (prefix, name, prefix, nearest_name(str(name), kind._fields)))
    for name in kind._fields:
        if name not in content and name not in kind._field_defaults:
            raise ValueError('the key %s%s is missing' % (prefix, name))
    return kind(**{name: _value(kind.__annotations__[name], value, prefix + name) for name, value in content.items()})


def _value(kind: Any, content: Any, where: str) -> Any:
    """Convert YAML content to a value of `kind`, the type of a field."""
    inner: Any = getattr(kind, '__args__', None) or ()
    if type(None) in inner:  # Optional
        return None if content is None else _value(inner[0], content, where)
    if hasattr(kind, '_fields'):
        return record_from(kind, content, where)
    if inner and isinstance(content, list) and content:
        return tuple(_value(inner[0], value, where) for value in content)
    if kind is float and isinstance(content, int) and not isinstance(content, bool):
        content = float(content)
    if type(content) is not kind or (kind is float and not math.isfinite(content)):
        raise ValueError('%s is %r; %s expected' % (where, content, EXPECTED.get(kind, 'a list of numbers')))
    return content


def record_text(record: Any) -> str:
    """The YAML text of a NamedTuple. Inverse of `record_from`."""
    text = ''
    for name, value in record._asdict().items():
        if hasattr(value, '_fields'):
            text += name + ':\n' + ''.join('  ' + line for line in record_text(value).splitlines(True))
        elif isinstance(value, tuple):
            text += '%s: [%s]\n' % (name, ', '.join(yaml.safe_dump(number).split()[0] for number in value))
        else:
            text += yaml.safe_dump({name: value}, default_flow_style=False, width=1000, allow_unicode=True)
    return text
