"""Recorded 3D detections with ground truth, from the camera of a moving robot or car, as runs of the benchmark.

A recording is a folder with `camera.json` (width, height, fx, fy, cx, cy) and four tables, whose columns are `TABLES`:
`detections.csv` has the centres of boxes in the optical frame, and `poses.csv` the poses of that frame in a fixed frame
with z up, both for each image. `truth.csv` has the centres of people in the fixed frame and whether they count.
`ignored.csv` has other objects in the fixed frame, such as cyclists, and regions of the image without annotation
(`DONT_CARE`). Scores outside of 0..1 are those of PointRCNN, and are converted to 0..1.
"""
import json
import os
from typing import Any, NamedTuple, Tuple

import numpy as np

from ros_3d_bb.camera.camera_model import Camera, transform_from, transform_points
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.tracking.types import OUT_OF_VIEW, VISIBLE, CameraView, Detection
from ros_3d_bb_lab.evaluation.matching import plane_distances
from ros_3d_bb_lab.evaluation.tracking.run_generator import HORIZONS_S, UNSCORED_M, Image, RunTruth
from ros_3d_bb_lab.evaluation.tracking.trajectories import pedestrian_of, read_rows

TABLES = {'detections': 't_s,x_m,y_m,z_m,width_m,height_m,score', 'poses': 't_s,x_m,y_m,z_m,qx,qy,qz,qw',
          'truth': 't_s,id,x_m,y_m,z_m,width_m,height_m,counts',
          'ignored': 't_s,kind,x_m,y_m,z_m,x1_px,y1_px,x2_px,y2_px'}
DONT_CARE = 'DontCare'
START_NS = 100 * NS  # stamp of the time 0
# Slope and offset of the log odds of PointRCNN's scores (Platt 1999), fitted to seven sequences of KITTI: half of the
# boxes at 2.59 are people. The offset moves them to the default `even_score` of the tracker.
PLATT = 1.36, 3.32
FARTHEST_M = 40.0  # people and tracks beyond are not scored
LONGEST_GAP_S = 0.5  # a longer gap in the truth of a person interrupts the curve through the positions


class RecordedRun(NamedTuple):
    """Images of one recording, as `run_generator.Run`; `unscored` has for each stamp the places (n, 2) of objects in
    the fixed frame, and the regions (m, 4) of the image in pixels (x1, y1, x2, y2), where tracks are not scored."""

    name: str
    images: Tuple[Image, ...]
    unscored: Any

    def in_scored_area(self, image, tracks):
        """Mask (n,) of the tracks that are false positives if no person is there."""
        if not tracks:
            return np.zeros(0, bool)
        camera, camera_from_fixed = image.view.intrinsics, np.linalg.inv(image.view.fixed_from_camera)
        centers_m = np.array([track.position_m for track in tracks])
        points = transform_points(camera_from_fixed, centers_m)
        counted = (points[:, 2] > 0) & (image.view.bearings(centers_m)[0] <= FARTHEST_M)
        pixels = camera.project(np.where(counted[:, None], points, (0, 0, 1)))
        counted &= ((pixels >= 0) & (pixels <= (camera.width - 1, camera.height - 1))).all(axis=1)
        places_m, regions_px = self.unscored[image.stamp_ns]
        others_m = np.concatenate((places_m, image.truth.position_m[image.truth.status != VISIBLE]))
        if len(others_m):
            counted &= plane_distances(centers_m, others_m).min(axis=1) >= UNSCORED_M
        low, high = regions_px[:, :2], regions_px[:, 2:]
        return counted & ~((pixels[:, None] >= low) & (pixels[:, None] <= high)).all(axis=2).any(axis=1)


def read_recordings(folder, every=1):
    """Yield the runs of the recordings in the subfolders of a folder, or of a folder that is itself a recording.

    `every` uses each n-th image.

    Raises ValueError if there is no recording, or a table has missing columns or invalid values; the message names the
    file.
    """
    names = sorted(name for name in os.listdir(folder) if os.path.isfile(os.path.join(folder, name, 'poses.csv')))
    if not names and not os.path.isfile(os.path.join(folder, 'poses.csv')):
        raise ValueError('%s has no recording; folders with camera.json, %s expected'
                         % (folder, ', '.join('%s.csv' % name for name in sorted(TABLES))))
    for path in [os.path.join(folder, name) for name in names] or [folder]:
        yield _read_recording(path, every)


def _read_recording(folder, every):
    camera = _camera(os.path.join(folder, 'camera.json'))
    tables = {name: read_rows(os.path.join(folder, name + '.csv'), columns.split(','), ('id', 'kind'))
              for name, columns in TABLES.items()}
    detections, poses = tables['detections'], tables['poses']
    stamps = [_stamp_ns(pose['t_s']) for pose in poses]
    cameras = {stamp: transform_from([pose[key] for key in ('x_m', 'y_m', 'z_m')],
                                     [pose[key] for key in ('qx', 'qy', 'qz', 'qw')])
               for stamp, pose in zip(stamps, poses)}
    are_logits = any(not 0 <= box['score'] <= 1 for box in detections)
    found, ignored = _by_stamp(detections), _by_stamp(tables['ignored'])
    people = _People(tables['truth'], set(stamps))
    images, unscored = [], {}
    for stamp in stamps[::every]:
        view = CameraView(cameras[stamp], camera, 'camera')
        boxes = [_detection(box, view.fixed_from_camera, are_logits) for box in found.get(stamp, [])]
        images.append(Image(stamp, boxes, view, people.at(stamp, view), stamp, view))
        unscored[stamp] = _unscored(ignored.get(stamp, []))
    return RecordedRun(os.path.basename(os.path.normpath(folder)), tuple(images), unscored)


class _People(object):
    """Ground truth of people: their positions are those of the table, at the stamps of images."""

    def __init__(self, rows, stamps):
        self._rows, self._curves = _by_stamp(rows), {}
        self._names = sorted(set(row['id'] for row in rows))
        for name in self._names:
            known = [row for row in rows if row['id'] == name and _stamp_ns(row['t_s']) in stamps]
            times_s = np.array([row['t_s'] for row in known])
            points_m = np.reshape([(row['x_m'], row['y_m']) for row in known], (-1, 2))
            cuts = np.flatnonzero(np.diff(times_s) > LONGEST_GAP_S) + 1
            self._curves[name] = [pedestrian_of(part_s, part_m) for part_s, part_m
                                  in zip(np.split(times_s, cuts), np.split(points_m, cuts)) if len(part_s) > 1]

    def at(self, stamp_ns, view):
        """RunTruth of an image; velocities and future positions are those of smoothed curves."""
        rows = self._rows.get(stamp_ns, [])
        velocity_mps = np.full((len(rows), 2), np.nan)
        future_m = np.full((len(rows), len(HORIZONS_S), 2), np.nan)
        for number, row in enumerate(rows):
            for curve in self._curves[row['id']]:
                if curve.start_s <= row['t_s'] <= curve.end_s:
                    velocity_mps[number] = curve.velocity_mps(row['t_s'])
                    known = row['t_s'] + HORIZONS_S <= curve.end_s
                    future_m[number, known] = curve.position_m(row['t_s'] + HORIZONS_S[known])
        status = np.array([VISIBLE if row['counts'] else OUT_OF_VIEW for row in rows], int)
        positions_m = np.reshape([(row['x_m'], row['y_m']) for row in rows], (-1, 2))
        ids = np.array([self._names.index(row['id']) for row in rows], int)
        pose = np.append(view.fixed_from_camera[:2, 3], np.arctan2(view.ahead[1], view.ahead[0]))
        return RunTruth(ids, positions_m, velocity_mps, future_m, status, pose)


def _detection(box, fixed_from_camera, is_logit):
    score = 1 / (1 + np.exp(-PLATT[0] * (box['score'] - PLATT[1]))) if is_logit else box['score']
    place_m = transform_points(fixed_from_camera, np.array([box['x_m'], box['y_m'], box['z_m']]))
    return Detection(place_m, np.array([box['width_m'], box['width_m'], box['height_m']]), score=score)


def _unscored(rows):
    """Places (n, 2) and regions (m, 4) of the rows of `ignored.csv` of one image."""
    places_m = [(row['x_m'], row['y_m']) for row in rows if row['kind'] != DONT_CARE]
    regions_px = [[row[key] for key in ('x1_px', 'y1_px', 'x2_px', 'y2_px')] for row in rows
                  if row['kind'] == DONT_CARE]
    return np.reshape(places_m, (-1, 2)), np.reshape(regions_px, (-1, 4))


def _stamp_ns(time_s):
    return START_NS + int(round(time_s * 1000)) * (NS // 1000)


def _by_stamp(rows):
    stamps = {}
    for row in rows:
        stamps.setdefault(_stamp_ns(row['t_s']), []).append(row)
    return stamps


def _camera(path):
    with open(path, encoding='utf-8') as stream:
        try:
            content = json.load(stream)
            return Camera(*(content[key] for key in ('width', 'height', 'fx', 'fy', 'cx', 'cy')))
        except (KeyError, TypeError, ValueError) as error:
            raise ValueError('%s: not a camera: %r; the keys width, height, fx, fy, cx, cy expected' % (path, error))
