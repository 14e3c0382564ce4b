"""The thesis' own form of a measurement session.

A text file `measurements.txt`, one line a snapshot: the positions of all boxes in whole millimetres, then when it was
taken, as in `[(-7, 3, 300), (2971, 535, 6102)];30-03-2021-11-49-54`; and beside it, of each time, the images
`measurements_TIME_raw.png` (colour), `_color.png` (colour with what was detected drawn into it) and `_depth.png`
(stretched to the whole range of its 8 or 16 bits). The first campaign has a space for the semicolon, and no raw
images. Nothing in the file is run: lines are matched against that form.
"""
import os
import re

from ros_3d_bb.measurements import SessionError, read_image
from ros_3d_bb.session_file import FILE_NAME

FORM = 'thesis'
TEXT_NAME = 'measurements.txt'
NOTES = (
    'The depth images of this form are stretched to the range of the image: distances cannot be recovered from them, '
    'so no box can be estimated.',
    'The camera (focal lengths, principal point, distortion) is not stored, and cannot be recovered.',
    'The 2D boxes are not stored; only the positions that were computed from them are.')
EXPECTED = 'positions and a time such as [(-7, 3, 300)];30-03-2021-11-49-54 expected; nothing in the file is run'
NUMBER = r'-?[0-9]{1,7}'
POSITION = r'\({0}, ?{0}, ?{0}\)'.format(NUMBER)
LINE = re.compile(r'\[((?:{0}(?:, ?{0})*)?)\][ ;] ?([\w-]{{1,60}})$'.format(POSITION))


def is_old_form(folder):
    """Whether a folder holds a session of the old form that the annotator has not written to yet."""
    return os.path.isfile(os.path.join(folder, TEXT_NAME)) and not os.path.exists(os.path.join(folder, FILE_NAME))


def read(folder):
    """The old form as the content of a frames.json, which says in "form" that it has no camera and no distances.

    Raises
    ------
    SessionError
        If the text cannot be read, or no line is of the form.
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
        raise SessionError('%s: no line of it is a measurement; %s' % (path, EXPECTED))
    return {'form': FORM, 'frames': frames}


def read_stretched(path):
    """A stretched depth image, (height, width), uint8 or uint16. Raises SessionError."""
    image = read_image(path)
    return image if image.ndim == 2 else image[..., 0]


def _entry_of(line, number, names, used):
    """The entry of a line, one that says what is wrong where the line is not of the form; counts times in `used`."""
    match = LINE.match(line)
    if match is None:
        return {'id': 'line-%d' % number,
                'unreadable': '%s, line %d is %.60r; %s' % (TEXT_NAME, number, line, EXPECTED)}
    time = match.group(2)
    used[time] = used.get(time, 0) + 1  # two in one second share their images
    stem = 'measurements_%s' % time
    color = stem + ('_raw.png' if stem + '_raw.png' in names else '_color.png')
    numbers = [int(number) for number in re.findall(NUMBER, match.group(1))]
    return {'id': time if used[time] == 1 else '%s-%d' % (time, used[time]), 'color': color,
            'stretched_depth': stem + '_depth.png',
            'detections': [{'estimate_mm': numbers[first:first + 3]} for first in range(0, len(numbers), 3)]}
