"""Sessions of ONNX Runtime, and checks of untrusted ONNX files."""
import contextlib
import resource

MAX_BYTES = 2 ** 30  # of a file
EXTRA_BYTES = 3 * 2 ** 28  # memory that a network may take beside its weights
# Messages inside of messages, {message: {field number: message}}, of
# https://github.com/onnx/onnx/blob/main/onnx/onnx.proto
MESSAGES = {
    'model': {7: 'graph', 20: 'training', 25: 'function'}, 'training': {1: 'graph', 2: 'graph'},
    'function': {7: 'node', 11: 'attribute'}, 'graph': {1: 'node', 5: 'tensor', 15: 'sparse tensor'},
    'node': {4: 'operator', 5: 'attribute'}, 'sparse tensor': {1: 'tensor', 2: 'tensor'},
    'attribute': {5: 'tensor', 6: 'graph', 10: 'tensor', 11: 'graph', 22: 'sparse tensor', 23: 'sparse tensor'},
    'tensor': {13: 'external data'}}
MAX_DEPTH = 20  # of messages in messages
ENDLESS = (b'Loop', b'Scan')
CPU, CUDA = 'CPUExecutionProvider', 'CUDAExecutionProvider'


def gpus_are_supported():
    """Whether the installed ONNX Runtime has the CUDA provider (package onnxruntime-gpu); False if none is there."""
    try:
        import onnxruntime
    except ImportError:
        return False
    return CUDA in onnxruntime.get_available_providers()


def session_of(model, threads, gpu=None):
    """Create an onnxruntime.InferenceSession, from a path or from bytes, whose waiting threads sleep.

    By default they spin, which takes a core from other nodes, and doubles the inference time if two share a free core.
    With `gpu`, the number of a GPU, the network runs there. Raises ValueError if ONNX Runtime cannot use it.
    """
    import onnxruntime
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads, options.inter_op_num_threads = threads, 1
    options.log_severity_level = 4
    options.add_session_config_entry('session.intra_op.allow_spinning', '0')
    if gpu is None:
        return onnxruntime.InferenceSession(model, options, providers=[CPU])
    session = onnxruntime.InferenceSession(model, options, providers=[(CUDA, {'device_id': gpu}), CPU])
    if session.get_providers()[0] != CUDA:
        raise ValueError('ONNX Runtime cannot use the GPU %d; its log names the missing library' % gpu)
    return session


def check_content(content):
    """Raise ValueError for an ONNX file, as bytes, that reads other files, or that may never return a result."""
    if len(content) > MAX_BYTES:
        raise ValueError('it is larger than %d MB' % (MAX_BYTES // 2 ** 20))
    to_visit = [('model', 0, len(content), 0)]
    while to_visit:
        message, start, end, depth = to_visit.pop()
        if depth > MAX_DEPTH:
            raise ValueError('it is nested too deeply')
        for field, at, until in _fields(content, start, end):
            kind = MESSAGES[message].get(field)
            if kind == 'external data':
                raise ValueError('weights are in another file; export it as one file')
            if kind == 'operator' and content[at:until] in ENDLESS:
                raise ValueError('it contains the operator %s' % content[at:until].decode())
            if kind in MESSAGES:
                to_visit.append((kind, at, until, depth + 1))


def _fields(content, at, end):
    """Yield (number, start, end) of the length-delimited fields of a protobuf message. Raises ValueError."""
    while at < end:
        key, at = _varint(content, at, end)
        wire_type = key & 7
        if wire_type == 0:
            _value, at = _varint(content, at, end)
        elif wire_type == 2:
            length, at = _varint(content, at, end)
            if length > end - at:
                raise ValueError('it is truncated or damaged')
            yield key >> 3, at, at + length
            at += length
        elif wire_type in (1, 5):
            at += 8 if wire_type == 1 else 4
        else:
            raise ValueError('it is not an ONNX file')
    if at != end:
        raise ValueError('it is truncated or damaged')


def _varint(content, at, end):
    value = shift = 0
    while at < end and shift < 70:
        byte = content[at]
        value |= (byte & 127) << shift
        at, shift = at + 1, shift + 7
        if byte < 128:
            return value, at
    raise ValueError('it is truncated or damaged')


@contextlib.contextmanager
def limited_memory(extra_bytes):
    """Context in which this process can allocate so many more bytes. Larger allocations raise exceptions."""
    soft, hard = resource.getrlimit(resource.RLIMIT_DATA)
    limit = _data_bytes() + extra_bytes
    for bound in (soft, hard):
        limit = limit if bound == resource.RLIM_INFINITY else min(limit, bound)
    resource.setrlimit(resource.RLIMIT_DATA, (limit, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_DATA, (soft, hard))


def _data_bytes():
    """Size of the data of this process, which the limit counts."""
    with open('/proc/self/status') as stream:
        return next(int(line.split()[1]) * 1024 for line in stream if line.startswith('VmData:'))
