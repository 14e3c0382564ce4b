"""Measurements in the old format of the thesis: measurements.txt, and images with stretched depth."""
import os

import cv2
import numpy as np

LINES = ('[(-7, 3, 300)];30-03-2021-11-49-54', '[(2971, 535, 6102), (-7, 2, 300)];30-03-2021-11-49-56',
         '[(24, 81, 2431)];30-03-2021-11-53-28', '[(24, 81, 2431)];30-03-2021-11-53-28', '[];30-03-2021-11-53-29')


def write_old_session(folder, lines=LINES):
    """Write the lines and the images of each time in them; returns the folder."""
    os.makedirs(folder, exist_ok=True)
    with open(os.path.join(folder, 'measurements.txt'), 'w') as stream:
        stream.write('\n'.join(lines) + '\n')
    depth = np.linspace(0, 2 ** 16 - 1, 64 * 48).reshape(48, 64).astype(np.uint16)
    for line in lines:
        time = line.replace(';', ' ').split()[-1]
        for kind in ('raw', 'color', 'depth'):
            image = depth if kind == 'depth' else np.full((48, 64, 3), 100 if kind == 'raw' else 200, np.uint8)
            cv2.imwrite(os.path.join(folder, 'measurements_%s_%s.png' % (time, kind)), image)
    return folder
