"""Reader of the old format of measurement sessions, which was used in the thesis.

The text file `measurements.txt` has one line per measurement: the positions of all boxes in integer millimetres, and
the time, as in `[(-7, 3, 300), (2971, 535, 6102)];30-03-2021-11-49-54`. For each time there are the images
`measurements_TIME_raw.png` (colour), `_color.png` (colour with drawn detections) and `_depth.png` (stretched to the
full range of 8 or 16 bits). The first campaign has a space instead of the semicolon, and no raw images. Lines are
matched by a regular expression; nothing in the file is executed.
"""
import os
import re

from ros_3d_bb.core.atomic_file import FILE_NAME
from ros_3d_bb.sessions.session_reader import SessionError, read_image

FORM = 'thesis'
TEXT_NAME = 'measurements.txt'
NOTES = (
    'The depth images of this format are stretched to the range of the image: distances cannot be recovered from '
    'them, so no box can be estimated.',
    'The camera (focal lengths, principal point, distortion) is not stored, and cannot be recovered.',
    'The 2D boxes are not stored; only the positions that were computed from them are.')
EXPECTED = 'positions and a time such as [(-7, 3, 300)];30-03-2021-11-49-54 expected; nothing in the file is executed'
NUMBER = r'-?[0-9]{1,7}'
POSITION = r'\({0}, ?{0}, ?{0}\)'.format(NUMBER)
LINE = re.compile(r'\[((?:{0}(?:, ?{0})*)?)\][ ;] ?([\w-]{{1,60}})$'.format(POSITION))


def is_old_format(folder):
    """Whether a folder contains a session in the old format without a frames.json."""
    return os.path.isfile(os.path.join(folder, TEXT_NAME)) and not os.path.exists(os.path.join(folder, FILE_NAME))


def read(folder):
    """Convert a session in the old format to the content of a frames.json. Its field "form" marks the missing camera.

    Raises SessionError if the text cannot be read, or no line has the format.
    """
    path = os.path.join(folder, TEXT_NAME)
    try:
        names = set(os.listdir(folder))
        with open(path, encoding='utf-8') as stream:
            lines = stream.read().splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise SessionError('%s: cannot be read (%s)' % (path, error))
    used = {}
    frames = [_entry_of(line.strip(), number, names, used) for number, line in enumerate(lines, 1) if line.strip()]
    if not used:
        raise SessionError('%s: it contains no measurements; %s' % (path, EXPECTED))
    return {'form': FORM, 'frames': frames}


def read_stretched(path):
    """Read a stretched depth image, (height, width), uint8 or uint16. Raises SessionError."""
    image = read_image(path)
    return image if image.ndim == 2 else image[..., 0]


def _entry_of(line, number, names, used):
    """Entry of a line. An invalid line gives an entry with the field "unreadable". Counts times in `used`."""
    match = LINE.match(line)
    if match is None:
        return {'id': 'line-%d' % number,
                'unreadable': '%s, line %d is %.60r; %s' % (TEXT_NAME, number, line, EXPECTED)}
    time = match.group(2)
    used[time] = used.get(time, 0) + 1  # measurements of the same second share their images
    stem = 'measurements_%s' % time
    color = stem + ('_raw.png' if stem + '_raw.png' in names else '_color.png')
    numbers = [int(number) for number in re.findall(NUMBER, match.group(1))]
    return {'id': time if used[time] == 1 else '%s-%d' % (time, used[time]), 'color': color,
            'stretched_depth': stem + '_depth.png',
            'detections': [{'estimate_mm': numbers[first:first + 3]} for first in range(0, len(numbers), 3)]}
