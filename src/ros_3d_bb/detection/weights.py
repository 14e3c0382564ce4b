"""What model files of all formats share: the error of unusable files, and class names."""
from ros_3d_bb.core.object_classes import COCO

MAX_CLASSES, MAX_NAME = 10000, 200


class WeightsError(ValueError):
    """Weights that cannot be used. The message names the file, the reason, and what was expected."""


def class_names(names, count):
    """Class names as a list, from the list or the {number: name} dict in a file.

    Without names, 80 classes are those of COCO. Other classes are named by their number.
    """
    if isinstance(names, (list, tuple)):
        names = dict(enumerate(names))
    if not isinstance(names, dict):
        names = dict(enumerate(COCO)) if count == len(COCO) else {}
    entries = [names.get(number, names.get(str(number))) for number in range(count)]  # keys are strings in JSON
    return [name if isinstance(name, str) and len(name) <= MAX_NAME else str(number)
            for number, name in enumerate(entries)]
