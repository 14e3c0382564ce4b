"""The YAML file beside an ONNX file, with what the ONNX file does not contain.

`model.yaml` belongs to `model.onnx`. Each key is optional; by default it is recognised or that of the family of heads.
"""
import os
from typing import NamedTuple

import yaml

from ros_3d_bb.core.error_text import cause
from ros_3d_bb.core.params import Param, parameters, params_from
from ros_3d_bb.core.yaml_loader import load_yaml
from ros_3d_bb.detection.network_detector import RESIZE_MODES
from ros_3d_bb.detection.onnx.heads import HEADS
from ros_3d_bb.detection.weights import MAX_CLASSES, MAX_NAME, WeightsError

MAX_BYTES = 10 ** 6
MAX_STRIDE = 1024
# Keys of the configuration files of NanoDet, PicoDet and ultralytics, and what replaces them here.
FOREIGN_KEYS = {
    'keep_ratio': 'resize gives this: center or corner if the aspect ratio is kept, stretch otherwise',
    'reg_max': 'the number of bins is read from the outputs', 'input_size': 'the size is read from the ONNX file',
    'imgsz': 'the size is read from the ONNX file'}


@parameters()
class ModelSettings(NamedTuple):
    """Head and input of a network."""

    head: str = Param('', 'Family of the head. Default: recognised by the outputs.', choices=('',) + tuple(HEADS))
    names: list = Param((), 'Names of the classes, in order. Default: those in the ONNX file, else COCO.')
    strides: list = Param((), 'Strides of the grid of the head, in order. Default: recognised, or of the head.')
    color: str = Param('', 'Order of the channels of the input. Default: of the head.', choices=('', 'rgb', 'bgr'))
    mean: list = Param((), 'Subtracted from the channels, in units of 0..255, in the order of color. Default: of '
                       'the head.')
    std: list = Param((), 'By which the channels are then divided, in units of 0..255. Default: of the head.')
    resize: str = Param('', 'How an image becomes the input. center: scaled and padded on two sides, corner: padded at '
                        'the right and at the bottom, stretch: not padded. Default: of the head.',
                        choices=('',) + RESIZE_MODES)
    padding: int = Param(-1, 'Grey level of the padding. -1: of the head.', limits=(-1, 255))


def read_settings(onnx_path):
    """ModelSettings in the YAML file beside an ONNX file; the defaults if there is none.

    Raises WeightsError if the file cannot be read, or contains an unknown key or a value that is not allowed.
    """
    path = os.path.splitext(onnx_path)[0] + '.yaml'
    try:
        with open(path, 'rb') as stream:
            content = stream.read(MAX_BYTES + 1)
        if len(content) > MAX_BYTES:
            raise ValueError('it is larger than %d bytes' % MAX_BYTES)
        return settings_from(load_yaml(content))
    except FileNotFoundError:
        return ModelSettings()
    except (OSError, ValueError, yaml.YAMLError) as error:
        raise WeightsError('%s, which describes %s, cannot be used (%s); fix or remove it, see doc/onnx.md'
                           % (path, os.path.basename(onnx_path), cause(error)))


def settings_from(content):
    """ModelSettings from the content of a YAML file. Raises ValueError."""
    content = {} if content is None else content
    if not isinstance(content, dict) or not all(isinstance(key, str) for key in content):
        raise ValueError('keys and values expected, such as "resize: stretch"; keys: %s'
                         % ', '.join(ModelSettings._fields))
    for key in sorted(set(content) & set(FOREIGN_KEYS)):
        raise ValueError('%s is not a key of this file: %s; remove it' % (key, FOREIGN_KEYS[key]))
    settings, = params_from(content, ModelSettings)
    for key in ('mean', 'std'):
        values = getattr(settings, key)
        if len(values) not in (0, 3) or not all(_is_number(value) and abs(value) <= 1e6 for value in values):
            raise ValueError('%s is %.100r; three numbers expected' % (key, values))
    if not all(value > 1e-6 for value in settings.std):
        raise ValueError('std is %.100r; numbers greater than 0 expected' % (settings.std,))
    for key in ('mean', 'std'):
        values = getattr(settings, key)
        if any(values) and max(map(abs, values)) < 1:
            raise ValueError('%s is %.100r, which is in units of 0..1; units of 0..255 expected: %s' % (
                key, values, [round(255.0 * value, 3) for value in values]))
    if len(settings.strides) > 8 or not all(type(value) is int and 1 <= value <= MAX_STRIDE
                                            for value in settings.strides):
        raise ValueError('strides is %.100r; whole numbers expected, such as [8, 16, 32]' % (settings.strides,))
    if len(settings.names) > MAX_CLASSES or not all(isinstance(name, str) and 0 < len(name) <= MAX_NAME
                                                    for name in settings.names):
        raise ValueError('names is %.100r; texts expected (in quotes if YAML reads them as something else)'
                         % (settings.names,))
    return settings


def _is_number(value):
    return isinstance(value, (int, float)) and not isinstance(value, bool) and value == value
