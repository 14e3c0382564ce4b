"""The layouts of the official YOLOv5 models, as a compact description of their published architecture."""
ANCHORS_P5 = [[10, 13, 16, 30, 33, 23], [30, 61, 62, 45, 59, 119], [116, 90, 156, 198, 373, 326]]
ANCHORS_P6 = [[19, 27, 44, 40, 38, 94], [96, 68, 86, 152, 180, 137], [140, 301, 303, 264, 238, 542],
              [436, 615, 739, 380, 925, 792]]
MULTIPLES = {'n': (0.33, 0.25), 's': (0.33, 0.50), 'm': (0.67, 0.75), 'l': (1.0, 1.0), 'x': (1.33, 1.25)}


def layout(release, model, class_count=80):
    """The `yaml` of a model such as 'n' or 'x6' of release '5.0' or '6.0' (the same to 7.0)."""
    depth, width = MULTIPLES[model[0]]
    channels = [128, 256, 512, 1024] if len(model) == 1 else [128, 256, 512, 768, 1024]
    repeats = [3, 6, 9, 3, 3] if release == '6.0' else [3, 9, 9, 3, 3]
    backbone = [[-1, 1, 'Conv', [64, 6, 2, 2]] if release == '6.0' else [-1, 1, 'Focus', [64, 3]]]
    for out, repeat in zip(channels, repeats):
        backbone += [[-1, 1, 'Conv', [out, 3, 2]], [-1, repeat, 'C3', [out]]]
    if release == '6.0':
        backbone.append([-1, 1, 'SPPF', [1024, 5]])
    else:  # the last block comes after the pooling, and without shortcuts
        pools = [5, 9, 13] if len(model) == 1 else [3, 5, 7]
        backbone[-1:] = [[-1, 1, 'SPP', [1024, pools]], [-1, 3, 'C3', [1024, False]]]
    rows = backbone + _head(channels, len(backbone))
    return {'nc': class_count, 'ch': 3, 'depth_multiple': depth, 'width_multiple': width,
            'anchors': ANCHORS_P5 if len(model) == 1 else ANCHORS_P6,
            'backbone': rows[:len(backbone)], 'head': rows[len(backbone):]}


def _head(channels, first):
    """Up through the scales, joining the backbone's, and down again; `first` is the index of its first row."""
    rows, laterals = [], []
    for level in range(len(channels) - 2, 0, -1):
        laterals.append(first + len(rows))
        rows += [[-1, 1, 'Conv', [channels[level], 1, 1]], [-1, 1, 'nn.Upsample', [None, 2, 'nearest']],
                 [[-1, 2 * level + 2], 1, 'Concat', [1]], [-1, 3, 'C3', [channels[level], False]]]
    outputs = [first + len(rows) - 1]
    for level in range(2, len(channels)):
        rows += [[-1, 1, 'Conv', [channels[level - 1], 3, 2]], [[-1, laterals.pop()], 1, 'Concat', [1]],
                 [-1, 3, 'C3', [channels[level], False]]]
        outputs.append(first + len(rows) - 1)
    return rows + [[outputs, 1, 'Detect', ['nc', 'anchors']]]
