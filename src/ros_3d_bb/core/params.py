"""Parameters of a node: a table of what they mean and allow, and from the parameter server to one checked type."""
import difflib
from collections import OrderedDict
from typing import Any, NamedTuple, Tuple, Union

LARGEST = 1e6


class Param(NamedTuple):
    """One row of a table of parameters: the default of a field of a NamedTuple, and what is known of it.

    Attributes
    ----------
    default : bool, int, float, str or tuple
    text : str
        What it means, in sentences. Empty where the `doc=` of the launch argument that sets it says so.
    unit : str
    limits : (number, number)
        Numbers outside are rejected.
    choices : tuple of str
        Other words are rejected; empty where any text is allowed.
    live : bool or (number, number)
        Whether the node takes changes while it runs. Of a number: how far the slider of rqt_reconfigure goes.
    section : str
        Heading in config/*.yaml and group in rqt_reconfigure.
    """

    default: Any
    text: str = ''
    unit: str = ''
    limits: Tuple[float, float] = (0, LARGEST)
    choices: Tuple[str, ...] = ()
    live: Union[bool, Tuple[float, float]] = False
    section: str = ''

    @property
    def allowed(self):
        """The values that are not rejected, in words."""
        low, high = self.limits
        if self.choices:
            return 'one of ' + ', '.join(self.choices)
        return '%g or more' % low if high == LARGEST else '%g to %.10g' % (low, high)

    @property
    def facts(self):
        """Unit, live or not, and what is allowed where that is not every number from 0 on or every text."""
        unit = 'Unit: %s.' % self.unit if self.unit else ''
        allowed = 'Allowed: %s.' % self.allowed if self.choices or self.limits != (0, LARGEST) else ''
        live = ('Live.' if self.live is True else 'Live: %g to %g.' % self.live) if self.live else ''
        return ' '.join(filter(None, (unit, allowed, live)))


SET_BY_LAUNCH = 'Set by launch files'
# The same in several nodes.
DEPTH_SCALE = Param(
    0.0, 'Metres per unit of the depth image. 0: taken from its encoding (REP 118: 16UC1 in millimetres, 32FC1 in '
    'metres).')
STAMP_TOLERANCE = Param(0.005, 'Largest difference between the stamps of images or boxes that belong together.', 's')
ENABLED = Param(True, 'Whether the detector runs from the start. The service ~enable changes it.')
PUBLISH_EMPTY = Param(True, 'Whether an empty array is published where no people are detected, so that tracks age.')
WAIT_FOR_SUBSCRIBERS = Param(0, 'Start once the colour image has this many subscribers, so that they miss no image.')


def parameters(section=''):
    """Class decorator for a NamedTuple whose fields have a Param in place of their default.

    The class keeps them by name, in `PARAMS`. A Param without a section gets the given one.
    """
    def decorate(kind):
        kind.PARAMS = OrderedDict((name, _in_section(kind._field_defaults[name], section)) for name in kind._fields)
        kind._field_defaults = {name: param.default for name, param in kind.PARAMS.items()}
        kind.__new__.__defaults__ = tuple(kind._field_defaults[name] for name in kind._fields)
        return kind
    return decorate


def _in_section(param, section):
    return param._replace(section=param.section or (section if param.text else SET_BY_LAUNCH))


def table_of(kinds):
    """The rows of several types as one table, {name: Param}; a name that they share has one row."""
    return OrderedDict((name, kind.PARAMS[name]) for kind in kinds for name in kind._fields)


def params_from(given, *kinds):
    """Fill NamedTuple types from a flat dictionary; what is not given keeps its default.

    A float may be given as an int, a str as a number (roslaunch turns `0` into one), a list as `a, b`.

    Parameters
    ----------
    given : dict
    *kinds : NamedTuple classes
        Decorated with `parameters`; fields annotated with bool, int, float, str or list.

    Returns
    -------
    list
        One instance of each class.

    Raises
    ------
    ValueError
        If a key is unknown (names the nearest known one), or a value has the wrong type or is not allowed.
    """
    known = [name for kind in kinds for name in kind._fields]
    for name in sorted(given):
        if name not in known:
            raise ValueError('unknown parameter ~%s; did you mean ~%s? Known: %s'
                             % (name, nearest_name(name, known), ', '.join(sorted(known))))
    filled = [kind(**{name: _converted(name, given[name], kind.__annotations__[name])
                      for name in kind._fields if name in given}) for kind in kinds]
    for params in filled:
        check(params)
    return filled


def nearest_name(name, known):
    """The one of the known names that a wrong one is most like."""
    return difflib.get_close_matches(name, known, 1, 0.0)[0]


def check(params):
    """Raise ValueError, naming the parameter, where a value is outside of what its row in the table allows."""
    for name, param in params.PARAMS.items():
        value = getattr(params, name)
        if isinstance(value, (int, float)) and not param.limits[0] <= value <= param.limits[1]:
            raise ValueError('parameter ~%s is %g; %s expected' % (name, value, param.allowed))
        for word in (value if isinstance(value, (list, tuple)) else [value]) if param.choices else ():
            if word not in param.choices:
                raise ValueError('parameter ~%s has %r; did you mean %s? Known: %s' % (
                    name, word, nearest_name(str(word), param.choices), ', '.join(param.choices)))


def _converted(name, value, kind):
    number = isinstance(value, (int, float)) and not isinstance(value, bool)
    if isinstance(value, kind) and isinstance(value, bool) == (kind is bool):
        return value
    if number and (kind is float or kind is str):
        return kind(value)
    if kind is list and isinstance(value, (str, int)):
        return [entry.strip() for entry in str(value).split(',') if entry.strip()]
    raise ValueError('parameter ~%s is %r, a %s; %s expected' % (name, value, type(value).__name__, kind.__name__))
