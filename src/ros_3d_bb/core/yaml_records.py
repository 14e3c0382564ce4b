"""Records in YAML files: NamedTuples whose fields are numbers, flags, texts, other records, and lists of them."""
from typing import Any, Callable, Sequence, Set, Tuple

import yaml

from ros_3d_bb.core.params import nearest_name

MOST = 1e10  # bound of the absolute value of numbers
EXPECTED = {float: 'a number', int: 'an integer', bool: 'true or false', str: 'text'}  # types of values
Check = Tuple[Set[str], Callable[[Any], bool], str]  # names of fields, whether a value is valid, what is expected


def record_from(kind: Any, content: Any, where: str = '', checks: Sequence[Check] = ()) -> Any:
    """Convert YAML content to a NamedTuple `kind`; `where` is its key. `checks` are of single numbers and texts.

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
    return kind(**{name: _value(kind.__annotations__[name], value, prefix + name, checks)
                   for name, value in content.items()})


def _value(kind: Any, content: Any, where: str, checks: Sequence[Check]) -> Any:
    """Convert YAML content to a value of `kind`, the type of a field."""
    inner: Any = getattr(kind, '__args__', None) or ()
    if type(None) in inner:  # Optional
        return None if content is None else _value(inner[0], content, where, checks)
    if hasattr(kind, '_fields'):
        return record_from(kind, content, where, checks)
    if inner:
        return _list(inner, content, where, checks)
    is_flag = isinstance(content, bool)  # which is an int, too
    if kind is float and isinstance(content, int) and not is_flag:
        content = float(content)
    if not isinstance(content, kind) or is_flag != (kind is bool) or (kind is not str and not abs(content) < MOST):
        raise ValueError('%s is %r; %s expected' % (where, content, EXPECTED[kind]))
    for names, is_valid, expected in checks:
        if where.rpartition('.')[2] in names and not is_valid(content):
            raise ValueError('%s is %r; %s expected' % (where, content, expected))
    return content


def _list(inner: Any, content: Any, where: str, checks: Sequence[Check]) -> Any:
    """Convert a list to a tuple. `inner` are the types in its brackets. Only a list of records may be empty."""
    has_records, count = hasattr(inner[0], '_fields'), None if inner[-1] is Ellipsis else len(inner)
    if not isinstance(content, list) or (count or len(content)) != len(content) or not (content or has_records):
        raise ValueError('%s is %r; %s expected' % (
            where, content, '%d numbers' % count if count else 'a list' if has_records else 'a list of numbers'))
    return tuple(_value(inner[0], entry, '%s[%d]' % (where, number) if has_records else where, checks)
                 for number, entry in enumerate(content, 1))


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
