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
        try:
            mark = Mark(cells[0], parse_length(cells[1]), parse_length(cells[2]))
            _check(mark, marks)
        except ValueError as error:
            raise ValueError('line %d: %s' % (number, error))
        marks.append(mark)
    return tuple(marks)


def _check(mark, others):
    """Raise ValueError if a mark cannot be used beside others."""
    if not mark.name:
        raise ValueError('the name is empty')
    if mark.name.casefold() in [other.name.casefold() for other in others]:
        raise ValueError('the name %s is not unique' % mark.name)
    if mark.z_m < LEAST_Z_M:
        raise ValueError('Z is %g mm; at least %g mm ahead of the camera expected. Check the unit'
                         % (1000 * mark.z_m, 1000 * LEAST_Z_M))
