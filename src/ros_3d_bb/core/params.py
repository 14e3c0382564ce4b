"""Parameters of a node: their schema, and conversion of the parameter server's values to validated NamedTuples."""
import difflib
import json
import re
import sys
from typing import Any, Callable, Dict, Iterable, List, Mapping, NamedTuple, Tuple, Union

LARGEST = 1e6
MAX_FLOAT = sys.float_info.max


class NestedList(str):
    """Type of a parameter that is a list of lists: as text, which dynamic_reconfigure can send, in the notation of YAML
    and JSON. A file may also contain the list itself."""


class ParamSchema(NamedTuple):
    """Schema of one parameter, given as the default of a field of a NamedTuple, under the name `Param`."""

    default: Any  # bool, int, float, str or tuple
    text: str = ''  # description in sentences; empty if the `doc=` of the corresponding launch argument describes it
    unit: str = ''
    limits: Tuple[float, float] = (0, LARGEST)  # values outside this range are rejected
    choices: Tuple[str, ...] = ()  # other values are rejected; empty if any text is allowed
    live: Union[bool, Tuple[float, float]] = False  # whether it can be changed at run time; for numbers, slider range
    section: str = ''  # heading in config/*.yaml and group in rqt_reconfigure

    @property
    def allowed(self) -> str:
        low, high = self.limits
        if self.choices:
            return 'one of ' + ', '.join(self.choices)
        return '%g or more' % low if high == LARGEST else '%g to %.10g' % (low, high)

    @property
    def facts(self) -> str:
        """Unit, allowed values unless they are the default (any text, or numbers from 0), and live range."""
        unit = 'Unit: %s.' % self.unit if self.unit else ''
        allowed = 'Allowed: %s.' % self.allowed if self.choices or self.limits != (0, LARGEST) else ''
        live = 'Live: %g to %g.' % self.live if isinstance(self.live, tuple) else 'Live.' if self.live else ''
        return ' '.join(filter(None, (unit, allowed, live)))


Param: Any = ParamSchema  # for type checkers: of the type of the field
SET_BY_LAUNCH = 'Set by launch files'
# Shared by several nodes.
DEPTH_SCALE = Param(
    0.0, 'Metres per unit of the depth image. 0: taken from its encoding (REP 118: 16UC1 in millimetres, 32FC1 in '
    'metres).')
DEPTH = Param('aligned', choices=('aligned', 'raw'))
STAMP_TOLERANCE = Param(0.0, 'Largest difference between the stamps of a colour and a depth image that belong '
                        'together. 0: half of the period of the depth images.', 's')
IMAGE_ROTATION = Param('auto', choices=('auto', '0', '90', '180', '270'))
CLASSES_FILE = Param('', 'Absolute path of a table of the classes of objects, in the format of config/classes.yaml; '
                     'empty: that table. All nodes need the same table.')
ROBOT_FRAME = Param('base_link')
TRACKS_TIMEOUT = Param(
    0.5, 'Tracks older than this, since the stamp of their image, count as missing. More than the pipeline takes from '
    'image to tracks, and a period of the images.', 's', limits=(0.05, 10.0))
WAIT_FOR_SUBSCRIBERS = Param(0, 'Start once the colour image has this many subscribers, so that they miss no image.')


def parameters(section: str = '') -> Callable[[Any], Any]:
    """Class decorator for a NamedTuple whose fields have a Param as their default.

    The Params are stored by name in the class attribute `PARAMS`. A Param without a section gets the given one.
    """
    def decorate(kind: Any) -> Any:
        kind.PARAMS = {}
        for name in kind._fields:
            param = kind._field_defaults[name]
            own_section = param.section or (section if param.text else SET_BY_LAUNCH)
            kind.PARAMS[name] = param._replace(section=own_section)
        kind._field_defaults = {name: param.default for name, param in kind.PARAMS.items()}
        kind.__new__.__defaults__ = tuple(kind._field_defaults[name] for name in kind._fields)
        return kind
    return decorate


def table_of(kinds: Iterable[Any]) -> Dict[str, ParamSchema]:
    """Merge the schemas of several types into one table, {name: Param}; shared names appear once."""
    return {name: kind.PARAMS[name] for kind in kinds for name in kind._fields}


def params_from(given: Mapping[str, Any], *kinds: Any) -> List[Any]:
    """Fill types decorated with `parameters` from a flat dictionary; missing keys keep their defaults.

    A float may be given as an int, a str as a number (roslaunch converts `0` to one), a list as `a, b`, a NestedList as
    a list. Returns a list with one instance of each type. Raises ValueError if a key is unknown (the message names the
    nearest known one), or a value has the wrong type or is not allowed.
    """
    known = [name for kind in kinds for name in kind._fields]
    for name in sorted(given):
        if name not in known:
            raise ValueError('unknown parameter ~%s; did you mean ~%s? Known: %s'
                             % (name, nearest_name(name, known), ', '.join(sorted(set(known)))))
    filled = [kind(**{name: _converted(name, given[name], kind.__annotations__[name])
                      for name in kind._fields if name in given}) for kind in kinds]
    for params in filled:
        check(params)
    return filled


def nearest_name(name: str, known: Iterable[str]) -> str:
    return difflib.get_close_matches(name, known, 1, 0.0)[0]


def check(params: Any) -> None:
    """Raise ValueError, naming the parameter, if a value is not allowed by its Param."""
    for name, param in params.PARAMS.items():
        value = getattr(params, name)
        if isinstance(value, (int, float)) and not param.limits[0] <= value <= param.limits[1]:
            if isinstance(value, int):
                value = max(-MAX_FLOAT, min(value, MAX_FLOAT))  # larger integers cannot be formatted
            raise ValueError('parameter ~%s is %g; %s expected' % (name, value, param.allowed))
        for word in (value if isinstance(value, (list, tuple)) else [value]) if param.choices else ():
            if word not in param.choices:
                raise ValueError('parameter ~%s has %r; did you mean %s? Known: %s' % (
                    name, word, nearest_name(str(word), param.choices), ', '.join(param.choices)))


def with_places(sentence: str, place_of: Callable[[str], str]) -> str:
    """Append to a sentence where the parameters that it names (~stride) are set.

    `place_of` returns the option or launch argument for the name of a parameter; empty if there is none.
    """
    names = sorted(set(re.findall(r'~([a-z]\w*)', sentence)))
    places = ['~%s: %s' % (name, place_of(name)) for name in names if place_of(name)]
    return sentence + (' (%s)' % '; '.join(places) if places else '')


def _converted(name: str, value: Any, kind: Any) -> Any:
    number = isinstance(value, (int, float)) and not isinstance(value, bool)
    if isinstance(value, kind) and isinstance(value, bool) == (kind is bool):
        return value
    if kind is NestedList:
        return json.dumps(value) if isinstance(value, list) else _converted(name, value, str)
    if number and (kind is float or kind is str):
        return kind(value)
    if kind is list and isinstance(value, (str, int)):
        return [entry.strip() for entry in str(value).split(',') if entry.strip()]
    raise ValueError('parameter ~%s is %r, a %s; %s expected' % (name, value, type(value).__name__, kind.__name__))
