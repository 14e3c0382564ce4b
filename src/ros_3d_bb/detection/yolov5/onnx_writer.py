"""Writer of ONNX files: the subset of the format that a network needs, in protobuf encoding.

The `onnx` package is missing on most robots, and torch's exporters differ between releases, so neither is used.
Field numbers: https://github.com/onnx/onnx/blob/main/onnx/onnx.proto
"""
import struct

import numpy as np

IR_VERSION, OPSET = 7, 13  # of ONNX 1.8; supported by ONNX Runtime since 1.6
FLOAT, UINT8 = 1, 2
ELEMENTS = {'float32': FLOAT, 'uint8': UINT8, 'int64': 7}
ATTRIBUTE_FIELDS = {float: (2, 1), int: (3, 2), str: (4, 3), list: (8, 7)}  # field and AttributeType of a value


class Graph(object):
    """Builder of an ONNX graph. Values are identified by names; `node` and `constant` return the name of the result."""

    def __init__(self):
        self._nodes, self._constants, self._count = [], [], 0

    def node(self, kind, inputs, **attributes):
        """Add an operator with one output. Attributes: int, float, str or list of int. Returns the output's name."""
        self._count += 1
        name = 'v%d' % self._count
        encoded = []
        for key in sorted(attributes):
            field, attribute_type = ATTRIBUTE_FIELDS[type(attributes[key])]
            encoded.append(_fields((1, key), (field, attributes[key]), (20, attribute_type)))
        self._nodes.append(_fields((1, list(inputs)), (2, name), (4, kind), (5, encoded)))
        return name

    def constant(self, values):
        """Add an array of float32 or int64 numbers. Returns its name."""
        values = np.asarray(values)
        name = 'c%d' % len(self._constants)
        self._constants.append(_fields((1, list(values.shape)), (2, ELEMENTS[values.dtype.name]), (8, name),
                                       (9, values.astype(values.dtype.newbyteorder('<')).tobytes())))
        return name

    def model(self, inputs, outputs, metadata):
        """Serialize the graph to the bytes of an ONNX file.

        Inputs and outputs are (name, element, shape): FLOAT or UINT8, and numbers or, for dynamic dimensions, names.
        """
        graph = _fields((1, self._nodes), (2, 'network'), (5, self._constants),
                        (11, [_value(*entry) for entry in inputs]), (12, [_value(*entry) for entry in outputs]))
        return (_fields((1, IR_VERSION), (2, 'ros_3d_bb'), (7, graph), (8, _fields((2, OPSET))))
                + b''.join(_fields((14, _fields((1, key), (2, metadata[key])))) for key in sorted(metadata)))


def _value(name, element, shape):
    dimensions = [_fields((2, size)) if isinstance(size, str) else _fields((1, size)) for size in shape]
    return _fields((1, name), (2, _fields((1, _fields((1, element), (2, _fields((1, dimensions))))))))


def _fields(*fields):
    """Encode (number, value) pairs; a list is a repeated field."""
    encoded = []
    for number, values in fields:
        for value in values if isinstance(values, list) else [values]:
            if isinstance(value, int):
                encoded.append(_varint(number << 3) + _varint(value))
            elif isinstance(value, float):
                encoded.append(_varint(number << 3 | 5) + struct.pack('<f', value))
            else:
                value = value.encode('utf-8') if isinstance(value, str) else value
                encoded.append(_varint(number << 3 | 2) + _varint(len(value)) + value)
    return b''.join(encoded)


def _varint(number):
    number &= 2 ** 64 - 1
    encoded = bytearray()
    while number > 127:
        encoded.append(number & 127 | 128)
        number >>= 7
    encoded.append(number)
    return bytes(encoded)
