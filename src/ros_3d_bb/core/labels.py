"""Names of classes of objects, as detectors give them, in messages."""
import re

PERSON = 'person'  # class of objects whose class is not given
MAX_LENGTH = 64  # characters of a name
UNUSABLE = re.compile(r'[^ -~]|[;,]')  # separators of the names in an array of 2D boxes, and anything but printable ASCII


def usable_label(name):
    """Replace the characters of a class name that messages cannot carry by underscores, and shorten a long name."""
    return UNUSABLE.sub('_', str(name).strip())[:MAX_LENGTH] or '_'


def label_fault(name):
    """Description of what is wrong with a class name from a message; empty if it can be used."""
    if name and len(name) <= MAX_LENGTH and not UNUSABLE.search(name):
        return ''
    return 'the class name %.80s; 1 to %d printable ASCII characters without ; and , expected' % (ascii(name), MAX_LENGTH)


def score_fault(score):
    """Description of what is wrong with a score from a message; empty if it can be used. 0 means unknown."""
    return '' if 0 <= score <= 1 else 'the score %g; 0..1 expected' % score
