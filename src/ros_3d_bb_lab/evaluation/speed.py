"""CPU time of 3D boxes and tracks by the number of people, for our and the thesis' algorithms (thesis, Fig. 4.2).

The times are from the depth image and the 2D boxes to tracks with predictions, without messages and waiting. Estimation
computes 3D boxes in the camera's frame; tracking transforms them to the fixed frame, tracks them and predicts. The
people of a measurement session are placed side by side in one wide depth image. All algorithms process the same image
and boxes, and take turns in being first, so that other load on the machine and cold caches affect all equally and their
ratios remain valid. The algorithms of the thesis are reimplemented.
"""
import functools
import itertools
import tempfile
import time
from typing import NamedTuple, Tuple

import numpy as np

from ros_3d_bb.camera.camera_model import OPTICAL_ROTATION, Camera, transform_from, transform_points
from ros_3d_bb.camera.images import DepthImage
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.estimation.box3d import ImageGeometry, plausible
from ros_3d_bb.estimation.box3d_estimator import estimate_boxes, estimator_named
from ros_3d_bb.sessions.session_reader import read_depth, read_session
from ros_3d_bb.tracking.occlusion import depths_towards
from ros_3d_bb.tracking.tracker import Tracker
from ros_3d_bb.tracking.types import CameraView, Detection, detections_from_boxes
from ros_3d_bb_lab.evaluation.baselines.original_tracker import OriginalTracker
from ros_3d_bb_lab.evaluation.defaults import data_folder, describe_machine, in_range
from ros_3d_bb_lab.evaluation.simulated_session import write_simulated_session
from ros_3d_bb_lab.evaluation.text_table import line_of, table_of

OBJECTS = (1, 2, 5, 10, 20, 50, 100)
WARM_UPS = 10  # images that are not timed, until tracks are confirmed and caches are warm
PERIOD_NS = NS // 30
FIXED_FROM_CAMERA = transform_from((0.0, 0.0, 1.0), OPTICAL_ROTATION)
AHEAD_S = 2.0  # horizon of the thesis' prediction
STAGES = 'estimation', 'tracking', 'both'
COVERED = 0.2  # share of a box that its neighbour covers
JITTER_PX = 2  # maximum change of the edges of a box between images
SIMULATED = (2.0, 4.0), (-0.2, 0.2), 2  # simulated session, used if no session is given


class Crowd(NamedTuple):
    """Wide depth image, its camera, and the 2D boxes of the people in it."""

    depth: DepthImage
    camera: Camera
    rects_px: Tuple[Tuple[int, int, int, int], ...]

    def jittered(self, random):
        """Boxes [(x1, y1, x2, y2)] with random jitter, as those of a detector in another image of the same scene."""
        edges = np.array(self.rects_px) + random.randint(-JITTER_PX, JITTER_PX + 1, (len(self.rects_px), 4))
        size = self.camera.width, self.camera.height
        return [tuple(rect_px) for rect_px in np.clip(edges, 0, size + size).tolist()]


def people_of(session):
    """Cut out the annotated person of each frame that has a box.

    Returns (depth values in the camera's units (height, width), top row) of each person. Raises SessionError.
    """
    people = []
    for frame in session.frames:
        if frame.boxes_px:
            x1, y1, x2, y2 = np.clip(frame.boxes_px[0], 0, (session.camera.width, session.camera.height) * 2)
            people.append((read_depth(frame, session).values[y1:y2, x1:x2], int(y1)))
    return people


def crowd_of(people, count, session):
    """Place `count` people of `people_of`, repeated cyclically, side by side in one depth image. Returns a Crowd.

    Each person covers a part of the person to the left.
    """
    rects_px, left = [], 0
    chosen = list(itertools.islice(itertools.cycle(people), count))
    for depth, top in chosen:
        height, width = depth.shape
        rects_px.append((left, top, left + width, top + height))
        left += int(width * (1 - COVERED))
    width, camera = max(rect_px[2] for rect_px in rects_px), session.camera
    values = np.zeros((camera.height, width), chosen[0][0].dtype)
    for (x1, y1, x2, y2), (depth, _top) in zip(rects_px, chosen):
        values[y1:y2, x1:x2] = depth
    return Crowd(DepthImage(values, session.depth_scale_m),
                 Camera(width, camera.height, camera.fx, camera.fy, width / 2.0, camera.cy), tuple(rects_px))


class Ours(object):
    """Algorithms of this package with the default parameters of its nodes."""

    def __init__(self, crowd):
        self._camera, self._tracker, self._estimator = crowd.camera, Tracker(), estimator_named('foreground')
        depth_at = functools.partial(depths_towards, crowd.camera, crowd.depth)
        self._view = CameraView(FIXED_FROM_CAMERA, crowd.camera, depth_at=depth_at)

    def estimate(self, depth, rects_px):
        return list(filter(plausible, estimate_boxes(depth, rects_px, self._camera, self._estimator)))

    def track(self, stamp_ns, boxes):
        detections = detections_from_boxes(dict(enumerate(boxes)), FIXED_FROM_CAMERA)
        return self._tracker.update(stamp_ns, detections, self._view)


class Theirs(object):
    """Algorithms of the thesis in the optimised version that its chapter 3 describes, reimplemented.

    Boxes are processed one by one, with arrays for the samples of a box (section 3.4.2) instead of the loops of the
    proof of concept, which is 2.5 times slower. Objects are processed one by one, with distances in one array (section
    3.6), and one prediction along the filtered velocity.
    """

    def __init__(self, crowd):
        self._camera, self._tracker = crowd.camera, OriginalTracker()

    def estimate(self, depth, rects_px):
        geometry = ImageGeometry(self._camera, (0, 0) + self._camera[:2])
        boxes = estimator_named('median').estimate(depth, rects_px, geometry, None)
        return [box for box in boxes if box is not None]

    def track(self, stamp_ns, boxes):
        detections = [Detection(transform_points(FIXED_FROM_CAMERA, box.center_m), box.size_m) for box in boxes]
        return {track.id: track.position_m + AHEAD_S * track.velocity_mps
                for track in self._tracker.step(stamp_ns, detections)}


def speed(session, counts=OBJECTS, images=60):
    """Measure the CPU time of the algorithms in `images` images for each number of people in `counts`.

    Returns a dictionary: `machine`, `people`, `images`, `objects` (= `counts`); for `ours` and `thesis` the medians of
    the times in ms by stage; and `ratio`, the median ratio of both times over both stages. Raises ValueError if no
    frame of the session has a box.
    """
    people, random = people_of(session), np.random.RandomState(0)
    if not people:
        raise ValueError('no frame of the session has a 2D box')
    random.shuffle(people)  # sessions are ordered by range
    times_ms = _times_ms([crowd_of(people, count, session) for count in counts], (Ours, Theirs), images, random)
    result = {'machine': describe_machine(), 'people': len(people), 'images': images, 'objects': list(counts)}
    both_ms = times_ms[..., STAGES.index('both')]
    for number, name in enumerate(('ours', 'thesis')):
        medians_ms = np.median(times_ms[:, :, number], axis=0).T.tolist()
        result[name] = dict(zip([stage + '_ms' for stage in STAGES], medians_ms))
    return dict(result, ratio=np.median(both_ms[:, :, 0] / both_ms[:, :, 1], axis=0).tolist())


def _times_ms(crowds, kinds, images, random):
    """CPU times of the images, (images, crowds, algorithms, stages); `kinds` create an algorithm for a crowd."""
    algorithms = [[kind(crowd) for kind in kinds] for crowd in crowds]
    times_ms = np.empty((images + WARM_UPS, len(crowds), len(kinds), len(STAGES)))
    for image in range(len(times_ms)):
        for number, crowd in enumerate(crowds):
            rects_px = crowd.jittered(random)
            for turn in range(len(kinds)):
                which = (image + turn) % len(kinds)
                times_ms[image, number, which] = _time_ms(algorithms[number][which], crowd.depth, rects_px,
                                                          image * PERIOD_NS)
    return times_ms[WARM_UPS:]


def _time_ms(algorithm, depth, rects_px, stamp_ns):
    start_s = time.process_time()
    boxes = algorithm.estimate(depth, rects_px)
    between_s = time.process_time()
    algorithm.track(stamp_ns, boxes)
    end_s = time.process_time()
    return 1e3 * (between_s - start_s), 1e3 * (end_s - between_s), 1e3 * (end_s - start_s)


def run(arguments):
    with tempfile.TemporaryDirectory() as folder:
        session = read_session(arguments.data or write_simulated_session(folder, *SIMULATED))
        result = speed(session, OBJECTS, arguments.images)
    result['data'] = arguments.data or 'simulated'
    print(line_of(**{key: result[key] for key in ('machine', 'people', 'data', 'images')}))
    rows = {'%s/%s' % (name, key): values for name in ('ours', 'thesis') for key, values in result[name].items()}
    rows['ratio'] = result['ratio']
    print('\n'.join(table_of({name: dict(zip(result['objects'], values)) for name, values in rows.items()})))
    return result


def add_options(parser):
    parser.add_argument('--data', default=data_folder('thesis'), metavar='DIR',
                        help='measurement session (default: $ROS_3D_BB_DATA/data/thesis, or simulated)')
    parser.add_argument('--images', type=in_range(int, 1), default=60,
                        help='timed images per number of people (default: 60)')
