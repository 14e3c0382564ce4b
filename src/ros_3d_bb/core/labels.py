"""Names of classes of objects, as detectors give them, in messages."""
import re

PERSON = 'person'  # class of objects whose class is not given
PEOPLE = PERSON, 'people', 'pedestrian', 'human'  # names of this class in data sets, in lower case
# Classes of the COCO data set by number, as YOLO and most other detectors name them (80 of the 91 of Lin et al., 2014).
COCO = (
    'person,bicycle,car,motorcycle,airplane,bus,train,truck,boat,traffic light,fire hydrant,stop sign,parking meter,'
    'bench,bird,cat,dog,horse,sheep,cow,elephant,bear,zebra,giraffe,backpack,umbrella,handbag,tie,suitcase,frisbee,'
    'skis,snowboard,sports ball,kite,baseball bat,baseball glove,skateboard,surfboard,tennis racket,bottle,wine glass,'
    'cup,fork,knife,spoon,bowl,banana,apple,sandwich,orange,broccoli,carrot,hot dog,pizza,donut,cake,chair,couch,'
    'potted plant,bed,dining table,toilet,tv,laptop,mouse,remote,keyboard,cell phone,microwave,oven,toaster,sink,'
    'refrigerator,book,clock,vase,scissors,teddy bear,hair drier,toothbrush').split(',')
MAX_LENGTH = 64  # characters of a name
UNUSABLE = re.compile(r'[^ -~]|[;,]')  # separators of names in an array of 2D boxes, and all but printable ASCII


def usable_label(name):
    """Replace the characters of a class name that messages cannot carry by underscores, and shorten a long name."""
    return UNUSABLE.sub('_', str(name).strip())[:MAX_LENGTH] or '_'


def described(label, text):
    """A short text about an object, after its class unless it is a person."""
    return text if label == PERSON else '%s %s' % (label, text)


def label_fault(name):
    """Description of what is wrong with a class name from a message; empty if it can be used."""
    if name and len(name) <= MAX_LENGTH and not UNUSABLE.search(name):
        return ''
    return ('the class name %.80s; 1 to %d printable ASCII characters without ; and , expected'
            % (ascii(name), MAX_LENGTH))


def score_fault(score):
    """Description of what is wrong with a score from a message; empty if it can be used. 0 means unknown."""
    return '' if 0 <= score <= 1 else 'the score %g; 0..1 expected' % score
