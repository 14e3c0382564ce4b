"""A measurement session of a red cardboard person in front of a wall, with exact ground truth."""
import json
import os

import cv2
import numpy as np

WIDTH, HEIGHT, FX, FY, CX, CY = 640, 480, 614.686, 614.842, 319.199, 242.08
WALL_M, CAMERA_HEIGHT_M = 4.5, 1.0
# X and Z of the person
PLACES_M = [(x, z) for z in (1.6, 2.0, 2.4, 2.8, 3.2) for x in (-0.4, 0.0, 0.4)] + [(0.9, 3.0), (-0.9, 3.0)]
FRAMES_PER_PLACE = 5


def write_synthetic_session(folder):
    random = np.random.RandomState(1)
    for name in ('color', 'depth'):
        os.makedirs(os.path.join(folder, name), exist_ok=True)
    frames = []
    for number in range(len(PLACES_M) * FRAMES_PER_PLACE):
        x_m, z_m = PLACES_M[number // FRAMES_PER_PLACE]
        color, depth_mm, box = _image_of(x_m, z_m, random)
        frame = {'id': 'frame-%03d' % number, 'color': 'color/%03d.png' % number, 'depth': 'depth/%03d.png' % number,
                 'box': box, 'estimate_mm': _median_by_loops(depth_mm, box),
                 'truth_mm': {'x': 1000 * x_m, 'z': 1000 * z_m}}
        cv2.imwrite(os.path.join(folder, frame['color']), color)
        cv2.imwrite(os.path.join(folder, frame['depth']), depth_mm)
        frames.append(frame)
    camera = {'width': WIDTH, 'height': HEIGHT, 'fx': FX, 'fy': FY, 'cx': CX, 'cy': CY, 'distortion': [0] * 5,
              'depth_scale': 0.001, 'frame': 'camera_color_optical_frame'}
    with open(os.path.join(folder, 'frames.json'), 'w') as stream:
        json.dump({'camera': camera, 'frames': frames}, stream)
    return folder


def _image_of(x_m, z_m, random):
    """BGR colour, depth in millimetres with holes and noise, and the 2D box of the person."""
    color = np.full((HEIGHT, WIDTH, 3), 170, np.uint8)
    color[HEIGHT // 2::24] = 120
    depth_mm = np.full((HEIGHT, WIDTH), WALL_M * 1000)
    left, right = (int(round((x_m + side * 0.25) / z_m * FX + CX)) for side in (-1, 1))
    top, bottom = (int(round((CAMERA_HEIGHT_M - height) / z_m * FY + CY)) for height in (1.75, 0.05))
    box = [max(left, 0), max(top, 0), min(right, WIDTH), min(bottom, HEIGHT)]
    body = np.s_[box[1]:box[3], box[0]:box[2]]
    color[body] = (30, 30, 200)
    depth_mm[body] = 1000 * z_m
    depth_mm += random.normal(0, 8, depth_mm.shape)
    depth_mm[random.random_sample(depth_mm.shape) < 0.1] = 0
    return color, depth_mm.astype(np.uint16), box


def _median_by_loops(depth_mm, box):
    """The thesis' estimate, written the slow way: nested loops, as its proof of concept."""
    (x1, y1, x2, y2), stride = box, 20
    columns, rows = -(-(x2 - x1) // stride), -(-(y2 - y1) // stride)
    left = x1 + (x2 - x1 - (columns - 1) * stride - 1) // 2
    top = y1 + (y2 - y1 - (rows - 1) * stride - 1) // 2
    points = []
    for v in range(top, y2, stride):
        for u in range(left, x2, stride):
            z = float(depth_mm[v, u])
            if z > 0:
                points.append(((u - CX) / FX * z, (v - CY) / FY * z, z))
    return [float(np.median([point[axis] for point in points])) for axis in range(3)]
