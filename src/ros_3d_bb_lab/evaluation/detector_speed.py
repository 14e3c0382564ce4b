"""CPU and wall time of the detector per image, by runtime and input size, with one thread."""
import time

import numpy as np

WARM_UPS = 2  # images that are not timed


def detector_speed(images, weights, runtimes=('torch', 'onnxruntime'), sizes=(640, 512)):
    """Measure the time of detection on the CPU, from the image to the boxes.

    All runtimes and sizes process each of the `images`, (height, width, 3) RGB, in turn, so that other load on the
    machine affects all of them equally and their ratios remain valid. `weights` is a checkpoint (.pt), the only format
    that every runtime supports; `sizes` are the longer side of the input in pixels.

    Returns a list of {runtime, size, threads, cpu_ms (of all threads of this process), wall_ms}, medians over the
    images. Raises ValueError if there are no images, or a runtime does not support these weights.
    """
    if not len(images):
        raise ValueError('no images; at least one image is required to measure the speed of the detector')
    cases = [(runtime, size, _detector(weights, runtime, size)) for runtime in runtimes for size in sizes]
    for _image in range(WARM_UPS):
        for _runtime, _size, detector in cases:
            detector.detect(images[0])
    times_ms = [[_time_ms(detector, image) for _runtime, _size, detector in cases] for image in images]
    return [{'runtime': runtime, 'size': size, 'threads': 1, 'cpu_ms': cpu_ms, 'wall_ms': wall_ms}
            for (runtime, size, _detector), (cpu_ms, wall_ms) in zip(cases, np.median(times_ms, axis=0).tolist())]


def _detector(weights, runtime, size):
    from ros_3d_bb.detection.yolov5.backends import RuntimeParams, open_runtime
    from ros_3d_bb.detection.yolov5.detector import DetectionParams, Yolov5
    running = RuntimeParams(runtime=runtime, device='cpu', threads=1)
    return Yolov5(open_runtime(weights, running), DetectionParams(image_size=size))


def _time_ms(detector, image):
    cpu_s, wall_s = time.process_time(), time.perf_counter()
    detector.detect(image)
    return (time.process_time() - cpu_s) * 1e3, (time.perf_counter() - wall_s) * 1e3
