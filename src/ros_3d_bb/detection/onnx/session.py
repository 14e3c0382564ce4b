"""Sessions of ONNX Runtime."""

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
