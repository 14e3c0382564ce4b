"""A TorchScript model with the output of YOLOv5 that detects red objects: weights that a test can write."""
import json

import torch


class RedDetector(torch.nn.Module):
    """One row: the bounding box of all red pixels, as class 0 of 80."""

    def forward(self, images):
        red = (images[0, 0] > 0.6) & (images[0, 1] < 0.4) & (images[0, 2] < 0.4)
        row = torch.zeros(1, 1, 85, device=images.device)
        columns = torch.nonzero(red.any(dim=0)).flatten()
        lines = torch.nonzero(red.any(dim=1)).flatten()
        if columns.numel() > 0:
            x1, x2 = float(columns[0]), float(columns[-1]) + 1.0
            y1, y2 = float(lines[0]), float(lines[-1]) + 1.0
            row[0, 0, :6] = torch.tensor([(x1 + x2) / 2, (y1 + y2) / 2, x2 - x1, y2 - y1, 0.95, 0.98])
        return (row,)


def write_red_detector(path, size=640):
    """Write it as YOLOv5's export does: with its shape, stride and names in config.txt. Returns the path."""
    config = {'shape': [1, 3, size, size], 'stride': 32, 'names': ['person'] + ['thing %d' % n for n in range(1, 80)]}
    torch.jit.script(RedDetector()).save(path, _extra_files={'config.txt': json.dumps(config)})
    return path
