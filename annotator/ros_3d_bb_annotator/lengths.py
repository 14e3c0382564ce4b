"""Lengths with units: parsing and formatting."""
import re

from ros_3d_bb.camera.images import FARTHEST_M

METRES = {'m': 1.0, 'cm': 0.01, 'mm': 0.001}


def parse_length(text):
    """Parse a length such as '1230', '1230 mm', '1.23 m' or '1,23 m' to metres. Without a unit it is in millimetres.

    Raises ValueError if the text is not a length, is ambiguous, or exceeds the range of depth cameras.
    """
    match = re.match(r'\s*([+\-\u2212]?)(\d+(?:[.,]\d*)?|[.,]\d+)\s*(mm|cm|m)?\s*$', text, re.ASCII)
    if match is None:
        raise ValueError('%.40r is not a length; a length such as 1230, 1230 mm or 1.23 m expected' % text)
    sign, number, unit = match.group(1), match.group(2), match.group(3) or 'mm'
    if unit == 'mm' and re.match(r'[1-9]\d{0,2},[0-9]{3}$', number):
        raise ValueError('%.40r could be %s mm or %s mm; write it without the comma'
                         % (text, number.replace(',', ''), number.replace(',', '.')))
    metres = float(number.replace(',', '.')) * METRES[unit]
    if metres > FARTHEST_M:
        raise ValueError('%.40r is %g m; at most %g m expected. Check the unit' % (text, metres, FARTHEST_M))
    return round(-metres if sign in ('-', '\u2212') else metres, 6) + 0.0  # no -0.0


def number_text(length_m, signed=False):
    """Format a length in millimetres without the unit, and with a minus sign as wide as the plus sign."""
    value_mm = round(1000 * length_m)
    return (('%+.0f' if signed and value_mm else '%.0f') % value_mm).replace('-', '\u2212')


def length_text(length_m, signed=False):
    return '%s mm' % number_text(length_m, signed)
