"""What model files of all formats share: the error of unusable files, and class names."""
import os

import yaml

from ros_3d_bb.core.error_text import cause
from ros_3d_bb.core.object_classes import COCO
from ros_3d_bb.core.yaml_loader import load_yaml

MAX_CLASSES, MAX_NAME = 10000, 200
MAX_BYTES = 10 ** 6  # of a file of class names


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


def names_beside(onnx_path):
    """Class names in the YAML file beside an ONNX file, `names: [person, dog]`; [] if there is none.

    Raises WeightsError if it cannot be read, or contains anything else.
    """
    path = os.path.splitext(onnx_path)[0] + '.yaml'
    try:
        with open(path, 'rb') as stream:
            content = stream.read(MAX_BYTES + 1)
        names = _names_in(load_yaml(content)) if len(content) <= MAX_BYTES else []
    except FileNotFoundError:
        return []
    except (OSError, yaml.YAMLError) as error:
        raise WeightsError('%s, with the class names of %s, cannot be read (%s); fix or remove it'
                           % (path, os.path.basename(onnx_path), cause(error)))
    if not 0 < len(names) <= MAX_CLASSES or not all(isinstance(name, str) and len(name) <= MAX_NAME for name in names):
        raise WeightsError('%s: the only key names with a list of texts expected (in quotes if YAML reads them as '
                           'something else), as "names: [person, dog]"; fix or remove it' % path)
    return names


def _names_in(content):
    is_names = isinstance(content, dict) and list(content) == ['names'] and isinstance(content['names'], list)
    return content['names'] if is_names else []
