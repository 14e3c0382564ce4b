"""A measurement session of small images, quick to write: two cardboard people in front of a wall, not yet annotated."""
import json
import os

import cv2
import numpy as np

CAMERA = {'width': 64, 'height': 48, 'fx': 60.0, 'fy': 60.0, 'cx': 32.0, 'cy': 24.0, 'distortion': [0] * 5,
          'depth_scale': 0.001, 'frame': 'camera_color_optical_frame'}
WALL_MM = 4000
NEAR_BOX, NEAR_MM = (10, 4, 26, 44), 2000
FAR_BOX, FAR_MM = (40, 10, 52, 42), 3000


def write_small_session(folder, count=4):
    """Write a session of `count` equal measurements with ids 'm0', 'm1', ...; returns the folder."""
    for name in ('color', 'depth'):
        os.makedirs(os.path.join(folder, name), exist_ok=True)
    with open(os.path.join(folder, 'frames.json'), 'w') as stream:
        json.dump({'camera': CAMERA, 'grid': [{'name': 'A1', 'x': -500, 'z': 2000}],
                   'frames': [write_measurement(folder, 'm%d' % number) for number in range(count)]}, stream)
    return folder


def write_measurement(folder, name):
    """Write the images of a measurement; returns its entry for frames.json."""
    depth_mm = np.full((CAMERA['height'], CAMERA['width']), WALL_MM, np.uint16)
    color = np.full(depth_mm.shape + (3,), 170, np.uint8)
    for (x1, y1, x2, y2), z_mm in ((FAR_BOX, FAR_MM), (NEAR_BOX, NEAR_MM)):
        depth_mm[y1:y2, x1:x2], color[y1:y2, x1:x2] = z_mm, (30, 30, 200)
    entry = {'id': name, 'color': 'color/%s.png' % name, 'depth': 'depth/%s.png' % name,
             'stamp': '1616161616.000000005', 'label': 'by the door',
             'detections': [{'box': list(NEAR_BOX), 'estimate_mm': [-466.5, 33, 2000], 'size_mm': [533, 1400],
                             'support': 0.9, 'truncated': False},
                            {'box': list(FAR_BOX), 'estimate_mm': [700, 100, 3000]}]}
    cv2.imwrite(os.path.join(folder, entry['color']), color)
    cv2.imwrite(os.path.join(folder, entry['depth']), depth_mm)
    return entry


def read_json(folder):
    with open(os.path.join(str(folder), 'frames.json')) as stream:
        return json.load(stream)


def change_json(folder, edit):
    content = read_json(folder)
    edit(content)
    with open(os.path.join(str(folder), 'frames.json'), 'w') as stream:
        json.dump(content, stream)
