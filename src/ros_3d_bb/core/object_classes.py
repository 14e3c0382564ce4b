"""Classes of objects: names, usual sizes, motion, and groups that detectors confuse. See config/classes.yaml."""
import re
from typing import Any, Dict, NamedTuple, Optional, Tuple

import numpy as np
import yaml

from ros_3d_bb.core.params import nearest_name
from ros_3d_bb.core.yaml_loader import load_yaml

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
MAX_SIZE_M, MAX_COORDINATE_M = 10.0, 1e8  # of boxes; chosen: objects and maps of no robot are larger
MAX_CLASSES, MAX_IN_GROUP = 200, 8
LARGEST_FACTOR = 100.0
# Relative to the usual height. Chosen: a tall person with raised arms, or with stretched ones, whose span is about the
# body height.
TALLEST_PERSON, WIDEST_PERSON = 1.6, 1.25


class ObjectClass(NamedTuple):
    """What is known about the objects of a class; lengths in metres.

    Tracks never change between groups; the group of a class is itself if it is None. `width` and `height` are usual
    extents, to which boxes are completed where the image border truncates them; 0 if unknown. `length` is the other
    horizontal extent of an elongated object, 0 otherwise. `axis` is the distance from the visible surface to the
    vertical axis; None: see `axis_behind`. `acceleration` and `initial_speed` are relative to those of people.
    """

    group: Optional[str] = None
    width: float = 0.0
    height: float = 0.0
    length: float = 0.0
    axis: Optional[float] = None
    acceleration: float = 1.0
    initial_speed: float = 1.0

    @property
    def largest_m(self) -> Tuple[float, float]:
        """Upper bounds of width and height, metres; those of people follow from their usual height."""
        if self.group == PERSON and self.height:
            return WIDEST_PERSON * self.height, TALLEST_PERSON * self.height
        return MAX_SIZE_M, MAX_SIZE_M

    def axis_behind(self, seen_m: float) -> float:
        """Distance from the visible surface to the vertical axis of an object that appears `seen_m` wide.

        Without a given distance, it is half of the width. An elongated object appears the wider the more it is seen
        from the side, where its axis is nearer: its outline is assumed to be an ellipse with the given length and
        width, whose extents across and along the viewing direction have a constant sum of squares.
        """
        if self.axis is not None:
            return self.axis
        if not self.length:
            return seen_m / 2
        along2 = self.length ** 2 + self.width ** 2 - seen_m ** 2
        return float(np.sqrt(max(along2, min(self.length, self.width) ** 2))) / 2


_SEAT, _LUGGAGE, _FURNITURE = 'seat', 'luggage', dict(acceleration=0.1, initial_speed=0.25)
DEFAULT_CLASS = ObjectClass()  # of classes that are not listed
# The distance to the axis of people is the mean over standing and walking bodies of the simulation, from all sides.
PERSON_CLASS = ObjectClass(PERSON, 0.46, 1.7, axis=0.09)
# The sizes of the other classes are estimates for usual objects, not measurements.
CLASSES = {
    PERSON: PERSON_CLASS,
    'bicycle': ObjectClass('two-wheeler', 0.6, 1.1, 1.75, acceleration=2.0, initial_speed=2.0),
    'motorcycle': ObjectClass('two-wheeler', 0.8, 1.1, 2.1, acceleration=2.0, initial_speed=2.0),
    'dog': ObjectClass('pet', 0.22, 0.55, 0.55, acceleration=2.0),
    'cat': ObjectClass('pet', 0.15, 0.3, 0.4, acceleration=2.0),
    'chair': ObjectClass(_SEAT, 0.5, 0.9, axis=0.18, **_FURNITURE),
    'couch': ObjectClass(_SEAT, 0.9, 0.85, 1.9, **_FURNITURE),
    'bench': ObjectClass(_SEAT, 0.5, 0.85, 1.5, **_FURNITURE),
    'suitcase': ObjectClass(_LUGGAGE, 0.3, 0.65, 0.45),
    'backpack': ObjectClass(_LUGGAGE, 0.3, 0.5, axis=0.1),
    'handbag': ObjectClass(_LUGGAGE, 0.3, 0.3, axis=0.1),
    'trolley': ObjectClass('trolley', 0.45, 1.0, 0.6),
    'potted plant': ObjectClass('potted plant', 0.4, 0.8, axis=0.15, **_FURNITURE)}
RANGES = {'width': MAX_SIZE_M, 'height': MAX_SIZE_M, 'length': MAX_SIZE_M, 'axis': MAX_SIZE_M,
          'acceleration': LARGEST_FACTOR, 'initial_speed': LARGEST_FACTOR}


class ObjectClasses(NamedTuple):
    """Table of classes: {name: ObjectClass} of those that are listed, and the ObjectClass of all others."""

    listed: Dict[str, ObjectClass] = CLASSES
    default: ObjectClass = DEFAULT_CLASS

    def of(self, label: str) -> ObjectClass:
        return self.listed.get(label, self.default)

    def standard_name(self, label: str) -> str:
        """Name of a class in this package: `PERSON` for its other names in data sets, such as Pedestrian, unless the
        table lists them."""
        return PERSON if label not in self.listed and label.lower() in PEOPLE else label

    def group_of(self, label: str) -> str:
        """Name of the group of a class: that of the table, or the class itself."""
        return self.of(label).group or label


def read_object_classes(path: str) -> ObjectClasses:
    """Read a table of classes in the format of config/classes.yaml; an empty path gives the table in the code.

    Raises ValueError if the file cannot be read, is not YAML, or has an unknown key or an invalid value; the message
    names the file, the key and the value.
    """
    if not path:
        return ObjectClasses()
    try:
        with open(path) as stream:
            return object_classes_from(load_yaml(stream))
    except (ValueError, OSError, yaml.YAMLError) as error:
        raise ValueError('the table of classes %s cannot be used: %s' % (path, error))


def object_classes_from(content: Any) -> ObjectClasses:
    """Convert the content of a file of classes to ObjectClasses. Raises ValueError."""
    if not (isinstance(content, dict) and set(content) <= {'classes', 'default'}
            and isinstance(content.get('classes'), dict)):
        raise ValueError('the keys classes (a mapping) and default expected')
    given = content['classes']
    if len(given) > MAX_CLASSES:
        raise ValueError('it has %d classes; at most %d expected' % (len(given), MAX_CLASSES))
    if PERSON not in given:
        raise ValueError('the class %s is missing' % PERSON)
    listed = {name: _class_from(name, entry) for name, entry in given.items()}
    default = _class_from('default', content.get('default') or {})
    if default.group is not None:
        raise ValueError('default.group is %r; each class that is not listed is a group of its own' % default.group)
    table = ObjectClasses(listed, default)
    groups = [table.group_of(name) for name in listed]
    for group in groups:
        if groups.count(group) > MAX_IN_GROUP:
            raise ValueError('the group %s has %d classes; at most %d expected'
                             % (group, groups.count(group), MAX_IN_GROUP))
    return table


def _class_from(name: Any, entry: Any) -> ObjectClass:
    if not isinstance(name, str) or label_fault(name):
        raise ValueError(label_fault(str(name)) or 'the class name %r is a %s; text expected, in quotes'
                         % (name, type(name).__name__))
    if not isinstance(entry, dict):
        raise ValueError('%s is %.80r; a mapping expected' % (name, entry))
    for key, value in entry.items():
        if key not in ObjectClass._fields:
            raise ValueError('%s has the unknown key %.80r; did you mean %s? Known keys: %s' % (
                name, key, nearest_name(str(key), ObjectClass._fields), ', '.join(ObjectClass._fields)))
        if key == 'group':
            if not isinstance(value, str) or label_fault(value):
                raise ValueError('%s.group is %.80r; a name expected' % (name, value))
        elif isinstance(value, bool) or not isinstance(value, (int, float)) or not 0 <= value <= RANGES[key]:
            raise ValueError('%s.%s is %.80r; a number from 0 to %g expected' % (name, key, value, RANGES[key]))
    values: Dict[str, Any] = {key: value if key == 'group' else float(value) for key, value in entry.items()}
    return ObjectClass(**values)


def usable_label(name: Any) -> str:
    """Replace the characters of a class name that messages cannot carry by underscores, and shorten a long name."""
    return UNUSABLE.sub('_', str(name).strip())[:MAX_LENGTH] or '_'


def described(label: str, text: str) -> str:
    """A short text about an object, after its class unless it is a person."""
    return text if label == PERSON else '%s %s' % (label, text)


def label_fault(name: str) -> str:
    """Description of what is wrong with a class name from a message; empty if it can be used."""
    if name and len(name) <= MAX_LENGTH and not UNUSABLE.search(name):
        return ''
    return ('the class name %.80s; 1 to %d printable ASCII characters without ; and , expected'
            % (ascii(name), MAX_LENGTH))


def score_fault(score: float) -> str:
    """Description of what is wrong with a score from a message; empty if it can be used. 0 means unknown."""
    return '' if 0 <= score <= 1 else 'the score %g; 0..1 expected' % score
