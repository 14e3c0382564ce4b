"""Simulated runs of a robot among recorded pedestrians: detections of its camera for each image, and ground truth.

Errors are as measured in the thesis and as specified for the D435. The same sequence, motion and seed give the same
run.
"""
import zlib
from typing import List, NamedTuple, Tuple

import numpy as np

from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.tracking.types import OCCLUDED, OUT_OF_VIEW, VISIBLE, CameraView, Detection
from ros_3d_bb_lab.evaluation.matching import plane_distances
from ros_3d_bb_lab.evaluation.tracking.d435_model import CameraModel, half_width, shown
from ros_3d_bb_lab.evaluation.tracking.detection_generator import HARD_TO_SEE, DetectablePerson, Detector
from ros_3d_bb_lab.evaluation.tracking.robot_motion import (PERIOD_S, STANDING, OdometryModel, bearing_of, driving,
                                                            from_frame, odometry_of, pose_at, to_frame, turned)

HORIZONS_S = np.array([0.5, 1.0, 1.5, 2.0])  # prediction horizons that are evaluated
CAMERA_HEIGHT_M = 0.5
START_S = 100.0  # stamp of the first image
SECONDS = 60.0
AROUND_M = (0.05, 9.0)  # people in this range of the robot are in the ground truth and occlude others
STAYS_S = 1.5  # after the end of the recording, a track of the person is not an error for this time
UNSCORED_M = 0.75  # a track within this distance of a person that is not scored most likely belongs to that person
BORDER, BORDER_M, NEAREST_M = 0.04, 0.15, 0.5  # margins of the scored field of view: radians, far end, near end
TRIES, COUNTED_EVERY_S = 25, 3.0  # random starts, and the interval for counting people in view
OPTICAL_FROM_BODY = np.array([[0, -1, 0], [0, 0, -1], [1, 0, 0]], float)


class Timing(NamedTuple):
    """Timing of images and detections, in seconds and shares of the images. A stall loses all images for `stall_s`."""

    rate_hz: float = 30.0
    stamp_sigma_s: float = 0.0007
    latency_s: float = 0.05
    latency_sigma_s: float = 0.005
    least_latency_s: float = 0.02
    least_gap_s: float = 0.008
    lost_share: float = 0.03
    stalls_hz: float = 0.05
    stall_s: float = 0.3


CAMERA, ODOMETRY, TIMING = CameraModel(), OdometryModel(), Timing()


class RunTruth(NamedTuple):
    """The n people around the robot at the time of an image, in the fixed frame according to the odometry at that time.

    `status` is VISIBLE (enough of the body is in view for a detection), OCCLUDED (in view, but mostly hidden) or
    OUT_OF_VIEW (or the recording has just ended); `future_m` (n, horizons, 2) is NaN after the end of the recording;
    `pose` (3,) is that of the robot.
    """

    ids: np.ndarray
    position_m: np.ndarray
    velocity_mps: np.ndarray
    future_m: np.ndarray
    status: np.ndarray
    pose: np.ndarray


class Image(NamedTuple):
    """Received image: inputs of a tracker, and ground truth.

    `arrival_view` is from tf at `arrival_ns`.
    """

    stamp_ns: int
    detections: List[Detection]
    view: CameraView
    truth: RunTruth
    arrival_ns: int
    arrival_view: CameraView


class Run(NamedTuple):
    """Images of one robot; `name` is that of the sequence and the motion, `camera` is the model of the camera."""

    name: str
    camera: CameraModel
    images: Tuple[Image, ...]

    def in_scored_area(self, image, tracks):
        """Mask (n,) of the tracks that are false positives if no person is there.

        The camera cannot decide this at the borders of its field of view, and near people that are not scored.
        """
        camera, truth = self.camera, image.truth
        places_m = np.array([track.position_m[:2] for track in tracks]).reshape(-1, 2)
        local_m = to_frame(truth.pose, places_m)
        range_m = np.linalg.norm(local_m, axis=1)
        scored = ((np.abs(bearing_of(local_m)) <= camera.field_of_view / 2 - BORDER) & (range_m >= NEAREST_M)
                  & (range_m <= camera.farthest_m - BORDER_M))
        others_m = truth.position_m[truth.status != VISIBLE]
        if len(others_m) and len(places_m):
            scored &= plane_distances(places_m, others_m).min(axis=1) >= UNSCORED_M
        return scored


class _Walks(NamedTuple):
    """People of a run (images, people, ...), NaN if not present; `ended` is whether the recording has ended."""

    position_m: np.ndarray
    velocity_mps: np.ndarray
    ended: np.ndarray
    future_m: np.ndarray


def simulate(sequence, motion, seed, seconds=SECONDS):
    """Simulate a run of a robot among the people of a sequence. Returns a Run.

    `motion` is STANDING or DRIVING, `seed` an int or a sequence of int, and `seconds` the maximum duration.
    """
    names = [zlib.crc32(name.encode('utf-8')) & 0xffffffff for name in (sequence.name, motion)]
    random = np.random.RandomState(np.append(np.atleast_1d(seed), names).astype(np.uint32))
    first_s, last_s = sequence.span_s
    seconds = min(seconds, last_s - first_s)
    start_s, true = _busiest(sequence, motion, seconds, CAMERA, random)
    odometry = odometry_of(true, ODOMETRY, random)
    times_s = np.arange(0, seconds, 1 / TIMING.rate_hz)
    walks = _walks(sequence.pedestrians, start_s + times_s)
    images = _images(true, odometry, times_s, walks, random)
    return Run('%s_%s' % (sequence.name, motion), CAMERA, tuple(images))


def _busiest(sequence, motion, seconds, camera, random):
    """Start time and true poses of the robot, out of random candidates the ones with most people in view."""
    first_s, last_s = sequence.span_s
    low_m, high_m = np.percentile(sequence.points_m, [8, 92], axis=0)
    best = None
    for _ in range(TRIES):
        start_s = random.uniform(first_s, max(first_s, last_s - seconds))
        if motion == STANDING:
            place_m = random.uniform(low_m, high_m)
            towards_m = sequence.points_m[random.randint(len(sequence.points_m))]
            pose = np.append(place_m, bearing_of(towards_m - place_m))
            poses = np.tile(pose, (int(round((seconds + 1) / PERIOD_S)) + 1, 1))
        else:
            place_m = (low_m + high_m) / 2 + random.normal(0, 0.8, 2)
            poses = driving(place_m, random.uniform(0, 2 * np.pi), random.uniform(), seconds + 1)
        count = sum(_in_view(sequence.pedestrians, start_s + time_s, poses[int(time_s / PERIOD_S)], camera)
                    for time_s in np.arange(0, seconds, COUNTED_EVERY_S))
        if best is None or count > best[0]:
            best = count, start_s, poses
    return best[1:]


def _in_view(pedestrians, time_s, pose, camera):
    places_m = [person.position_m(time_s) for person in pedestrians if person.start_s <= time_s <= person.end_s]
    local_m = to_frame(pose, np.reshape(places_m, (-1, 2)))
    range_m = np.linalg.norm(local_m, axis=1)
    return np.count_nonzero((range_m > 0.5) & (range_m < camera.farthest_m)
                            & (np.abs(bearing_of(local_m)) < camera.field_of_view / 2))


def _walks(pedestrians, times_s):
    there = [person for person in pedestrians if person.start_s <= times_s[-1] and person.end_s + STAYS_S >= times_s[0]]
    shape = (len(times_s), len(there))
    walks = _Walks(np.full(shape + (2,), np.nan), np.full(shape + (2,), np.nan), np.zeros(shape, bool),
                   np.full(shape + (len(HORIZONS_S), 2), np.nan))
    for column, person in enumerate(there):
        rows = np.flatnonzero((times_s >= person.start_s) & (times_s <= person.end_s + STAYS_S))
        known_s = np.minimum(times_s[rows], person.end_s)
        over_s = times_s[rows] - known_s
        velocity_mps = person.velocity_mps(known_s)
        walks.velocity_mps[rows, column] = velocity_mps
        walks.position_m[rows, column] = person.position_m(known_s) + over_s[:, None] * velocity_mps
        walks.ended[rows, column] = over_s > 0
        for number, horizon_s in enumerate(HORIZONS_S):
            known = rows[times_s[rows] + horizon_s <= person.end_s]
            walks.future_m[known, column, number] = person.position_m(times_s[known] + horizon_s)
    return walks


def _images(true, odometry, times_s, walks, random):
    """Yield the received images in order. `true` and `odometry` are poses of the robot."""
    detector = Detector(CAMERA, walks.ended.shape[1], 1 / TIMING.rate_hz, random)
    pose_noise = ODOMETRY.position_m, ODOMETRY.position_m, ODOMETRY.heading
    arrived_s, stalled_until_s = -np.inf, -np.inf
    for row, time_s in enumerate(times_s):
        pose = pose_at(true, time_s)
        detector.advance(pose)
        if random.uniform() < TIMING.stalls_hz / TIMING.rate_hz:
            stalled_until_s = time_s + TIMING.stall_s
        if random.uniform() < TIMING.lost_share or time_s < stalled_until_s:
            continue
        latency_s = max(TIMING.least_latency_s, random.normal(TIMING.latency_s, TIMING.latency_sigma_s))
        arrived_s = max(time_s + latency_s, arrived_s + TIMING.least_gap_s)
        truth, seen = _observe(walks, row, pose, pose_at(odometry, time_s), CAMERA)
        found = detector.find(seen, pose, time_s)
        measured, later = (pose_at(odometry, when_s) + random.normal(0, pose_noise) for when_s in (time_s, arrived_s))
        view = view_of(measured, CAMERA)
        stamp_s = START_S + time_s + random.normal(0, TIMING.stamp_sigma_s)
        stamp_ns, arrival_ns = (int(round(when_s * NS)) for when_s in (stamp_s, START_S + arrived_s))
        yield Image(stamp_ns, [detection_of(box, view, CAMERA) for box in found], view, truth,
                    arrival_ns, view_of(later, CAMERA))


def _observe(walks, row, pose, odometry, camera):
    """RunTruth of an image, and its list of DetectablePerson."""
    local_m = to_frame(pose, walks.position_m[row])
    range_m = np.linalg.norm(np.where(np.isfinite(local_m), local_m, np.inf), axis=1)
    ids = np.flatnonzero((range_m > AROUND_M[0]) & (range_m < AROUND_M[1]))
    local_m, range_m, bearing = local_m[ids], range_m[ids], bearing_of(local_m[ids])
    there = ~walks.ended[row, ids] & (np.abs(bearing) < np.pi / 2)
    half_view = camera.field_of_view / 2
    share, middle, cut = shown(bearing, np.where(there, half_width(range_m), 1e-3), range_m, half_view)
    share = np.where(there, share, 0)
    inside = (there & (np.abs(bearing) < half_view) & (local_m[:, 0] > camera.nearest_m)
              & (range_m < camera.farthest_m))
    velocity_mps, turn = walks.velocity_mps[row, ids], odometry[2] - pose[2]
    truth = RunTruth(ids, from_frame(odometry, local_m), turned(turn, velocity_mps),
                     from_frame(odometry, to_frame(pose, walks.future_m[row, ids])),
                     np.where(inside, np.where(share >= HARD_TO_SEE, VISIBLE, OCCLUDED), OUT_OF_VIEW), odometry)
    heading = bearing_of(velocity_mps) - pose[2]
    seen = [DetectablePerson(ids[i], local_m[i, 0], range_m[i], middle[i], share[i], cut[i],
                             np.linalg.norm(velocity_mps[i]), heading[i]) for i in np.flatnonzero(share > 0)]
    return truth, seen


def view_of(pose, camera):
    fixed_from_camera = np.eye(4)
    body = np.eye(3)
    body[:2, :2] = turned(pose[2], np.eye(2)).T
    fixed_from_camera[:3, :3] = body.dot(OPTICAL_FROM_BODY.T)
    fixed_from_camera[:3, 3] = pose[0], pose[1], CAMERA_HEIGHT_M
    return CameraView(fixed_from_camera, camera.intrinsics, 'camera')


def detection_of(box, view, camera):
    rotation = view.fixed_from_camera[:3, :3]
    point_m = (-box.depth_m * np.tan(box.bearing), CAMERA_HEIGHT_M - box.height_m / 2, box.depth_m)
    covariance_m2 = rotation.dot(camera.covariance_m2(box.bearing, box.depth_m)).dot(rotation.T)
    left = bool(box.cut) and box.bearing > 0
    return Detection(rotation.dot(point_m) + view.fixed_from_camera[:3, 3],
                     np.array([box.width_m, box.width_m, box.height_m]), covariance_m2,
                     (left, False, bool(box.cut) and not left, False))
