"""Floor marks as text: one mark per line with name, X and Z, separated by tabs, semicolons, commas or spaces."""
import re

from ros_3d_bb_annotator.lengths import parse_length
from ros_3d_bb_annotator.measurement import Mark

HEADER = re.compile(r'(name|mark|label)\b', re.IGNORECASE)
LEAST_Z_M = 0.05  # people stand farther away; probably metres without a unit


def mark_of(name, x, z, where):
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


def checked(marks):
    """Return marks as a tuple. Raises ValueError if a name is not unique."""
    names = [mark.name.casefold() for mark in marks]
    twice = [mark.name for number, mark in enumerate(marks) if mark.name.casefold() in names[:number]]
    if twice:
        raise ValueError('the name %s is not unique' % twice[0])
    return tuple(marks)


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
        marks.append(mark_of(*cells, where='line %d' % number))
    return checked(marks)


def grid_of(x_texts, z_texts):
    """Marks of a grid: columns A, B, C... at the lengths in `x_texts`, rows 1, 2, 3... at those in `z_texts`.

    The lengths are separated by semicolons or spaces. Raises ValueError.
    """
    columns, rows = (text.replace(';', ' ').split() for text in (x_texts, z_texts))
    if not columns or not rows or len(columns) > 26:
        raise ValueError('1 to 26 lengths for X and at least one for Z expected')
    return tuple(mark_of('%s%d' % (chr(ord('A') + column), row), x, z, 'X %s, Z %s' % (x, z))
                 for row, z in enumerate(rows, 1) for column, x in enumerate(columns))
