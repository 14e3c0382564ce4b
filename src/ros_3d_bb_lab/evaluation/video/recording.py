"""RGB-D videos of a camera that does not move, and the people that are marked in their images.

A video is a folder with `color/NAME.jpg` or `.png`, `depth/NAME.png` (16 bits, aligned to colour) and `camera.json`
(`width`, `height`, `K` of nine numbers without lens distortion, and `depth_unit_m`). The images follow each other in
the order of their names. The truth is a JSON file: `rate`, images per second, and `frames`, the list of the people in
each marked image by its name: `id`, `rect` (x1, y1, x2, y2) of the visible part, pixels, and `visible`, the visible
share of the body.
"""
import json
import os
from typing import NamedTuple, Tuple

import cv2
import numpy as np

from ros_3d_bb.camera.camera_model import Camera
from ros_3d_bb.camera.images import DepthImage, mounted_camera
from ros_3d_bb.detection.depth.ground_plane import camera_pose_above, fit_floor

FLOOR_IMAGES = 8  # that the pose of the camera is fitted to, as with `process_bag --camera-pose floor`


class Person(NamedTuple):
    id: int
    rect_px: Tuple[float, float, float, float]  # of the visible part
    visible: float  # share of the body


class Truth(NamedTuple):
    """The marked people (list of Person) by the name of the image; `rate_hz` is that of all images."""

    rate_hz: float
    frames: dict


class Video(NamedTuple):
    """A video: its `images` are (name, path of the colour image, path of the depth image)."""

    camera: Camera
    depth_unit_m: float
    images: Tuple[Tuple[str, str, str], ...]

    def read(self):
        """Yield (name, RGB image, DepthImage) in order. Raises ValueError if an image cannot be read."""
        size = self.camera.height, self.camera.width
        for name, color_path, depth_path in self.images:
            color, depth = cv2.imread(color_path), cv2.imread(depth_path, cv2.IMREAD_UNCHANGED)
            for path, image in ((color_path, color), (depth_path, depth)):
                if image is None or image.shape[:2] != size:
                    raise ValueError('%s: not an image of %d x %d pixels, the size in camera.json'
                                     % (path, size[1], size[0]))
            yield name, np.ascontiguousarray(color[..., ::-1]), DepthImage(depth, self.depth_unit_m)

    def camera_pose(self):
        """Pose (4, 4) of the camera above the floor that its first images show. Raises ValueError if none does."""
        floors = []
        for _name, _color, depth in self.read():
            floors += filter(None, [fit_floor(depth, self.camera)])
            if len(floors) == FLOOR_IMAGES:
                break
        if not floors:
            raise ValueError('no image shows the floor, to which the pose of the camera is fitted')
        height_m, tilt_rad, roll_rad = camera_pose_above(floors)
        return mounted_camera(height_m, tilt_rad, 0, roll_rad)


def read_video(folder):
    """Read the Video in a folder. Raises ValueError if it is incomplete, OSError if there is no camera.json."""
    path = os.path.join(folder, 'camera.json')
    with open(path) as stream:
        content = _content(stream, path)
    try:
        fx, _skew, cx, _zero, fy, cy = content['K'][:6]
        camera = Camera(content['width'], content['height'], fx, fy, cx, cy)
        unit_m = float(content['depth_unit_m'])
    except (KeyError, TypeError, ValueError) as error:
        raise ValueError('%s: not a camera: %r; the keys width, height, K and depth_unit_m expected' % (path, error))
    images = []
    for file_name in sorted(os.listdir(os.path.join(folder, 'color'))):
        name = os.path.splitext(file_name)[0]
        depth = os.path.join(folder, 'depth', name + '.png')
        if not os.path.isfile(depth):
            raise ValueError('%s is missing; a depth image for each colour image expected' % depth)
        images.append((name, os.path.join(folder, 'color', file_name), depth))
    return Video(camera, unit_m, tuple(images))


def read_truth(path, video):
    """Read the Truth of a Video. Raises ValueError if it is invalid, or has an image that the video does not have."""
    with open(path) as stream:
        content = _content(stream, path)
    try:
        rate_hz, frames = float(content['rate']), content['frames']
        people = {name: [Person(int(person['id']), tuple(map(float, person['rect'])), float(person['visible']))
                         for person in marked] for name, marked in frames.items()}
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise ValueError('%s: not the people of a video: %r; rate, and frames with id, rect and visible expected'
                         % (path, error))
    missing = sorted(set(people) - set(name for name, _color, _depth in video.images))
    if missing or not people:
        raise ValueError('%s: %s; names of the images of the video expected'
                         % (path, 'image %r' % missing[0] if missing else 'no images'))
    return Truth(rate_hz, people)


def _content(stream, path):
    try:
        return json.load(stream)
    except ValueError as error:
        raise ValueError('%s: not JSON: %s' % (path, error))
