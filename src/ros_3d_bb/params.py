"""Parameters of a node: from the dictionary that ROS hands over to one checked type."""
import difflib


def params_from(given, *kinds):
    """Fill NamedTuple types from a flat dictionary; what is not given keeps its default.

    A float may be given as an int, a str as a number (roslaunch turns `0` into one), a list as `a, b`.

    Parameters
    ----------
    given : dict
    *kinds : NamedTuple classes
        Fields annotated with bool, int, float, str or list, all with defaults.

    Returns
    -------
    list
        One instance of each class.

    Raises
    ------
    ValueError
        If a key is unknown (names the nearest known one) or a value has the wrong type.
    """
    known = [name for kind in kinds for name in kind._fields]
    for name in sorted(given):
        if name not in known:
            raise ValueError('unknown parameter ~%s; did you mean ~%s? Known: %s'
                             % (name, nearest_name(name, known), ', '.join(sorted(known))))
    return [kind(**{name: _converted(name, given[name], kind.__annotations__[name])
                    for name in kind._fields if name in given}) for kind in kinds]


def nearest_name(name, known):
    """The one of the known names that a wrong one is most like."""
    return difflib.get_close_matches(name, known, 1, 0.0)[0]


def check_not_negative(params, *names):
    """Raise ValueError, naming the parameter, where one of the named numbers is negative, nan or absurdly large."""
    for name in names:
        if not 0 <= getattr(params, name) < 1e6:
            raise ValueError('parameter ~%s is %g; 0 or more expected' % (name, getattr(params, name)))


def _converted(name, value, kind):
    number = isinstance(value, (int, float)) and not isinstance(value, bool)
    if isinstance(value, kind) and isinstance(value, bool) == (kind is bool):
        return value
    if number and (kind is float or kind is str):
        return kind(value)
    if kind is list and isinstance(value, (str, int)):
        return [entry.strip() for entry in str(value).split(',') if entry.strip()]
    raise ValueError('parameter ~%s is %r, a %s; %s expected' % (name, value, type(value).__name__, kind.__name__))
