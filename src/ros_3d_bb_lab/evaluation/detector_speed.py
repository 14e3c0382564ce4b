"""CPU and wall time of the detector per image, by runtime, input size and number of threads."""
import time

import numpy as np

WARM_UPS = 2  # images that are not timed


def detector_speed(images, weights, runtimes=('torch', 'onnxruntime'), sizes=(640, 512), threads=(1,)):
    """Measure the time of detection, from the image to the boxes.

    For each number of threads, all runtimes and sizes process each image in turn, so that other load on the machine
    affects all of them equally and their ratios remain valid.

    Parameters
    ----------
    images : list of numpy.ndarray, (height, width, 3), uint8, RGB
    weights : str
        A checkpoint (.pt), the only format that every runtime supports.
    runtimes : sequence of str
        See `ros_3d_bb.detection.yolov5.backends`. All runtimes use the CPU.
    sizes : sequence of int
        Longer side of the input, pixels.
    threads : sequence of int

    Returns
    -------
    list of dict
        runtime, size, threads, cpu_ms (of all threads of this process) and wall_ms. Times are medians over the images.

    Raises
    ------
    ValueError
        If there are no images, or a runtime does not support these weights.
    """
    if not len(images):
        raise ValueError('there are no images to time the detector on')
    rows = []
    for count in threads:
        cases = [(runtime, size, _detector(weights, runtime, size, count)) for runtime in runtimes for size in sizes]
        times_ms = np.median(_times_ms([detector for _runtime, _size, detector in cases], images), axis=0)
        rows += [{'runtime': runtime, 'size': size, 'threads': count, 'cpu_ms': cpu_ms, 'wall_ms': wall_ms}
                 for (runtime, size, _detector), (cpu_ms, wall_ms) in zip(cases, times_ms.tolist())]
    return rows


def _detector(weights, runtime, size, threads):
    from ros_3d_bb.detection.yolov5.backends import RuntimeParams, open_runtime
    from ros_3d_bb.detection.yolov5.detector import DetectionParams, Yolov5
    running = RuntimeParams(runtime=runtime, device='cpu', threads=threads)
    return Yolov5(open_runtime(weights, running), DetectionParams(image_size=size))


def _times_ms(detectors, images):
    """CPU and wall time of each detector for each image, (images, detectors, 2)."""
    for image in images[:1] * WARM_UPS:
        for detector in detectors:
            detector.detect(image)
    return np.array([[_time_ms(detector, image) for detector in detectors] for image in images])


def _time_ms(detector, image):
    cpu_s, wall_s = time.process_time(), time.perf_counter()
    detector.detect(image)
    return (time.process_time() - cpu_s) * 1e3, (time.perf_counter() - wall_s) * 1e3
