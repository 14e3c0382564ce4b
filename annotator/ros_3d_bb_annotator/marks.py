"""Floor marks as text: one mark per line with name, X and Z, separated by tabs, semicolons, commas or spaces."""
import re
from typing import NamedTuple

from ros_3d_bb_annotator.lengths import parse_length

HEADER = re.compile(r'(name|mark|label)\b', re.IGNORECASE)
LEAST_Z_M = 0.05  # people stand farther away; probably metres without a unit


class Mark(NamedTuple):
    """Marked position on the floor in the camera's optical frame: X to the right, Z forward, in metres."""

    name: str
    x_m: float
    z_m: float


def parse_marks(text):
    """Marks of a table as text: a CSV file, or cells of a spreadsheet. A header is skipped. Raises ValueError."""
    marks = []
    for number, line in enumerate(text.splitlines(), 1):
        if not line.strip():
            continue
        separator = next((one for one in ('\t', ';', ',') if line.count(one) >= 2), None)
        cells = [cell.strip().strip('"') for cell in line.split(separator)]
        if not marks and HEADER.match(cells[0]) and not re.search('[0-9]', ''.join(cells[1:])):
            continue  # a header, not a mark such as "Mark 1"
        if len(cells) != 3:
            raise ValueError('line %d is %.60r; name, X and Z expected, such as A1, -600, 1500' % (number, line))
        mark = _mark_of(*cells, where='line %d' % number)
        if mark.name.casefold() in [other.name.casefold() for other in marks]:
            raise ValueError('the name %s is not unique' % mark.name)
        marks.append(mark)
    return tuple(marks)


def _mark_of(name, x, z, where):
    """Mark of texts. Raises ValueError, whose message starts with `where`."""
    if not name.strip():
        raise ValueError('%s: the name is empty' % where)
    try:
        mark = Mark(name.strip(), parse_length(x), parse_length(z))
    except ValueError as error:
        raise ValueError('%s: %s' % (where, error))
    if not mark.z_m > 0:
        raise ValueError('%s: Z is %s; more than 0 expected, as the camera looks along Z' % (where, z.strip()))
    if mark.z_m < LEAST_Z_M:
        raise ValueError('%s: Z is %s, %g mm; at least %g mm expected. Check the unit'
                         % (where, z.strip(), 1000 * mark.z_m, 1000 * LEAST_Z_M))
    return mark
