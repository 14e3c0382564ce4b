"""What model files of all formats share: the error of unusable files, and class names."""

MAX_CLASSES, MAX_NAME = 10000, 200
COCO = (
    'person', 'bicycle', 'car', 'motorcycle', 'airplane', 'bus', 'train', 'truck', 'boat', 'traffic light',
    'fire hydrant', 'stop sign', 'parking meter', 'bench', 'bird', 'cat', 'dog', 'horse', 'sheep', 'cow', 'elephant',
    'bear', 'zebra', 'giraffe', 'backpack', 'umbrella', 'handbag', 'tie', 'suitcase', 'frisbee', 'skis', 'snowboard',
    'sports ball', 'kite', 'baseball bat', 'baseball glove', 'skateboard', 'surfboard', 'tennis racket', 'bottle',
    'wine glass', 'cup', 'fork', 'knife', 'spoon', 'bowl', 'banana', 'apple', 'sandwich', 'orange', 'broccoli',
    'carrot', 'hot dog', 'pizza', 'donut', 'cake', 'chair', 'couch', 'potted plant', 'bed', 'dining table', 'toilet',
    'tv', 'laptop', 'mouse', 'remote', 'keyboard', 'cell phone', 'microwave', 'oven', 'toaster', 'sink',
    'refrigerator', 'book', 'clock', 'vase', 'scissors', 'teddy bear', 'hair drier', 'toothbrush')


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
