"""Visibility of tracked people in one or several cameras: visible, occluded by a person or an object, or out of view.

The latest image of each camera classifies each undetected track, and the best result is used. A track that one camera
cannot see is therefore neither out of view nor missed while another camera detects it, sees it occluded or should
detect it. A camera that stops sending images is ignored after a short time.
"""
import itertools
import math
from typing import Dict, Iterable, NamedTuple, Optional, Sequence, Set, Tuple

import numpy as np

from ros_3d_bb.camera.camera_model import Camera
from ros_3d_bb.camera.images import DepthImage
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.tracking.kalman_filter import State
from ros_3d_bb.tracking.track import PRESENT, SEEN, STAYED, Track
from ros_3d_bb.tracking.types import NEARER_M, OCCLUDED, OUT_OF_VIEW, VISIBLE, CameraView, wrapped

# All are chosen; `./run bench scenes` and `./run bench tracking` show the effect of others.
EDGE_RAD = 0.04  # people this close to the image border are not detected reliably
NEAREST_M = 0.45  # neither are people this close to the camera
BLIND_M = 1.0  # most depth cameras measure nothing nearer than 0.3 to 0.8 m; the axis of a body is behind its surface
LEAST_IN_IMAGE = 0.2  # minimum share of the body axis inside the image for a person to be detected
RELIABLE_IN_IMAGE = 0.5  # detectors often fail if less of the body axis is in the image
AXIS_SAMPLES = np.linspace(-0.48, 0.48, 11)  # samples of the body axis, as fractions of the height from the centre
BODY_RADIUS_M = 0.27
SEEN_BESIDE = 0.2  # an occluding person leaves at most this share of a half width visible: too narrow for a detector
HIDDEN_BEHIND_M = 0.5  # measured depth nearer than the person by more than this belongs to another object
HIDDEN_SHARE = 0.5
PRESENT_SHARE = 0.3  # of the measured depth; legs fill no more of the width of a body
# Depth sample points, in half extents.
ACROSS, ALONG = np.meshgrid((-0.6, -0.3, 0, 0.3, 0.6), (-0.8, -0.4, 0, 0.4, 0.8))

# The same for a body that fills the image: in half widths, slopes, and the largest bearing.
RAYS_ACROSS, RAYS_UP, RAYS_RAD = np.linspace(-0.9, 0.9, 7), (-0.2, 0.0, 0.2), 1.2

STATUS = {VISIBLE: OCCLUDED, OCCLUDED: OCCLUDED, OUT_OF_VIEW: OUT_OF_VIEW, PRESENT: OCCLUDED,
          STAYED: OCCLUDED, SEEN: VISIBLE}
RECENT_NS = NS  # a camera whose latest image is older is ignored
BEHIND_M = 0.45  # upper bound of the position's standard deviation of a person who stays behind an occluder
PRESENT_M = 0.3  # the same of one whose place is occupied, and of one who stands there: within 10 s, people who wait
STANDING_M = 0.1  # move by 0.06 m along each axis (RMS, the VRU Trajectory Dataset), beside the error of the position
STOPPING_S = 0.5  # time constant of the velocity of a person who does not come as near as predicted
PRESENT_NS = 30 * NS  # without a detection for longer, what occupies the place may be a wall, which never leaves
# Distance of the tracks of one person in two places, and time for which each is missed by one camera; chosen.
CONTRADICTING_M, CONTRADICTING_NS = 1.5, 5 * NS
Visibilities = Dict[int, int]  # by track ID


class CameraState(NamedTuple):
    """The latest image of a camera, and the range in which people are expected to be detected."""

    stamp_ns: int
    view: CameraView
    range_m: float


def recent_others(cameras: Dict[str, CameraState], camera: str, stamp_ns: int) -> Dict[str, CameraState]:
    """The {name: CameraState} of each camera but `camera` that is not ignored in an image with this stamp."""
    return {name: other for name, other in cameras.items() if name != camera and stamp_ns - other.stamp_ns <= RECENT_NS}


def mark_missed(missed: Sequence[Track], tracks: Iterable[Track], before: Iterable[Track],
                cameras: Dict[str, CameraState], camera: str, observed_s: float, detection_probability: float) -> None:
    """Update undetected tracks in place: status, visibility, track score, and the time for which they are unseen.

    An occluded person who is predicted to reappear but is not detected is assumed to stay behind the occluder: the
    track keeps its previous position. A person whose place is occupied does not become less certain than `PRESENT_M`,
    until `PRESENT_NS` after the latest detection, and does not come nearer than what occupies it; who stands stays
    there, with `STANDING_M`. A person who walks up to a camera stops before it, as people do in front of a robot.

    `missed` are those of the `tracks` that are not detected; they are predicted to the stamp of the image. `before` are
    the tracks after the previous image. `cameras` maps each camera to its CameraState; `camera` is that of the image,
    which accounts for `observed_s` seconds. `detection_probability` is that of a visible person.
    """
    former = {track.id: track for track in before}
    occluding = [track for track in tracks if track.is_confirmed]
    image, others = cameras[camera], recent_others(cameras, camera, cameras[camera].stamp_ns)
    seen, staying = _seen_and_staying(missed, former, occluding, image, others)
    views, decay = [image.view] + [other.view for other in others.values()], math.exp(-observed_s / STOPPING_S)
    for track in missed:
        track.set_visibility(camera, seen[track.id], image.stamp_ns)
        best = min([seen[track.id]] + [track.visibility.get(name, OUT_OF_VIEW) for name in others])
        is_known = track.is_confirmed and image.stamp_ns - track.last_ns <= PRESENT_NS
        if best in (PRESENT, STAYED) and not is_known:
            best = OUT_OF_VIEW
        _hold(track, former[track.id].state, best, track.id in staying, views, decay)
        track.miss(STATUS[best], 0.0 if best in (PRESENT, STAYED, SEEN) else observed_s,
                   observed_s if best == VISIBLE else 0.0, detection_probability)


def _seen_and_staying(missed: Sequence[Track], before: Dict[int, Track], occluding: Sequence[Track],
                      image: CameraState, others: Dict[str, CameraState]) -> Tuple[Visibilities, Set[int]]:
    """The visibility {ID: visibility} of missed tracks in the view of a CameraState, and the IDs of those that stay
    behind an occluder, in this one or in those of the `others` {name: CameraState}.
    """
    seen, former = _now_and_before(missed, before, occluding, image)
    staying = set(track.id for track in missed if track.status == former.get(track.id) == OCCLUDED)
    seen.update(dict.fromkeys(staying, OCCLUDED))
    seen.update({track_id: STAYED for track_id, visibility in former.items() if visibility in (PRESENT, STAYED)})
    for name, other in others.items():
        hidden = [track for track in missed if track.status == track.visibility.get(name) == OCCLUDED
                  and seen[track.id] != VISIBLE]
        _there, former = _now_and_before(hidden, before, occluding, other)
        staying.update(track_id for track_id, visibility in former.items() if visibility == OCCLUDED)
    return seen, staying


def _now_and_before(tracks: Sequence[Track], before: Dict[int, Track], occluding: Sequence[Track],
                    image: CameraState) -> Tuple[Visibilities, Visibilities]:
    """The `_visibilities` of tracks, and of those that should be visible, the `_former_visibilities`."""
    seen = _visibilities(tracks, occluding, image)
    return seen, _former_visibilities([track for track in tracks if seen[track.id] == VISIBLE], before, occluding,
                                      image)


def _hold(track: Track, former: State, seen: int, is_staying: bool, views: Iterable[CameraView], decay: float) -> None:
    """Keep an undetected track near its former State where its visibility `seen` shows that the person has not gone on;
    `decay` is the share of the velocity that one who stops keeps."""
    if seen == STAYED or seen == PRESENT and not track.is_moving:
        _stop(track, former, decay)
    elif seen == PRESENT:
        track.state = State(*(track.state[:4] + _bounded(track.state, former, PRESENT_M)))
    elif seen == OCCLUDED and is_staying:  # at the previous position
        track.state = State(*(former[:4] + _bounded(track.state, former, BEHIND_M)))
    elif seen == OUT_OF_VIEW and any(_meets(track, former, view) for view in views):
        _stop(track, former, decay)


def contradicting_cameras(tracks: Iterable[Track], stamp_ns: int) -> Optional[Tuple[str, str]]:
    """The names of two cameras that seem to show one person in two places, None without: for `CONTRADICTING_NS`, each
    has one of two tracks nearby in view and does not detect it, while it detects the other one, and at most one of the
    tracks is occluded.
    """
    candidates = []
    for track in tracks:
        detecting = set(camera for camera, seen in track.visibility.items() if seen == SEEN)
        missing = set(camera for camera, seen in track.visibility.items()
                      if seen in (VISIBLE, OCCLUDED) and stamp_ns - track.since_ns[camera] >= CONTRADICTING_NS)
        if missing and track.is_confirmed and stamp_ns - track.last_ns <= RECENT_NS:
            candidates.append((track, detecting, missing))
    for (track, detecting, missing), (other, other_detecting, other_missing) in itertools.combinations(candidates, 2):
        distance_m = math.hypot(track.state.x - other.state.x, track.state.y - other.state.y)
        if distance_m < CONTRADICTING_M and track.kind.group == other.kind.group:
            for camera, other_camera in itertools.product(detecting & other_missing, other_detecting & missing):
                if VISIBLE in (track.visibility[other_camera], other.visibility[camera]):
                    return min(camera, other_camera), max(camera, other_camera)
    return None


def _meets(track: Track, former: State, view: CameraView) -> bool:
    """Whether someone who walks would pass a camera at the height of the body nearer than `NEAREST_M`, and may stand at
    the place of the former State: it is in view, and the depth image does not show that it is empty."""
    if view.depth_at is None or not track.is_moving:
        return False
    camera_x, camera_y, camera_z = view.fixed_from_camera[:3, 3].tolist()
    u, v, speed_mps = former.u, former.v, math.hypot(former.u, former.v)
    to_x, to_y = camera_x - former.x, camera_y - former.y
    is_ahead = to_x * u + to_y * v > 0 and abs(to_x * v - to_y * u) < NEAREST_M * speed_mps
    is_near = (camera_x - track.state.x) * u + (camera_y - track.state.y) * v < NEAREST_M * speed_mps
    if not (is_ahead and is_near and abs(camera_z - track.z_m) < track.size_m[2] / 2):
        return False
    return not _is_empty(view, former)


def _is_empty(view: CameraView, place: State) -> bool:
    """Whether most of the rays of an image towards a body at the place of a State, so near that it fills the image or a
    part of it, are measured clearly behind it; also if all of them are outside the image."""
    (distance_m,), (bearing,) = view.bearings(np.array([(place.x, place.y)]))
    half_width = math.asin(min(BODY_RADIUS_M / max(distance_m, 0.01), 1))
    bearings = np.clip(bearing + half_width * RAYS_ACROSS, -RAYS_RAD, RAYS_RAD)
    ahead = view.ahead
    left = np.array((-ahead[1], ahead[0]))
    level = np.cos(bearings)[:, None] * ahead + np.sin(bearings)[:, None] * left
    directions = np.array([(x, y, up) for x, y in level for up in RAYS_UP])
    points = directions.dot(view.fixed_from_camera[:3, :3])
    pixels = view.intrinsics.project(np.where(points[:, 2:] > 0, points, (0, 0, 1)))
    is_inside = (points[:, 2] > 0) & ((pixels >= 0) & (pixels < view.intrinsics[:2])).all(axis=1)
    with np.errstate(invalid='ignore'):  # nan is not behind
        behind = view.depth_at(points[is_inside]) > distance_m + HIDDEN_BEHIND_M
    return np.count_nonzero(behind) >= HIDDEN_SHARE * np.count_nonzero(is_inside)


def _stop(track: Track, former: State, share: float) -> None:
    """Return a track to its former State, with a share of the velocity."""
    (slow_u, slow_v), most_m = track.slow_mps, PRESENT_M if track.is_moving else STANDING_M
    track.slow_mps = share * slow_u, share * slow_v
    track.state = State(former.x, former.y, share * former.u, share * former.v, *_bounded(track.state, former, most_m))


def _visibilities(tracks: Sequence[Track], occluding: Sequence[Track], image: CameraState) -> Visibilities:
    """The visibility {ID: PRESENT, STAYED, VISIBLE, OCCLUDED or OUT_OF_VIEW} of tracks in the view of a CameraState."""
    if not tracks:
        return {}
    visibility = classify_visibility(image.view, _positions_of(tracks), np.array([track.size_m for track in tracks]),
                                     _positions_of(occluding), image.range_m)
    return dict(zip([track.id for track in tracks], visibility.tolist()))


def _former_visibilities(tracks: Iterable[Track], before: Dict[int, Track], occluding: Sequence[Track],
                         image: CameraState) -> Visibilities:
    """As `_visibilities`, at the previous positions of the tracks, which do not occlude themselves there."""
    return {track.id: _visibilities([before[track.id]], [other for other in occluding if other.id != track.id],
                                    image)[track.id] for track in tracks}


def _bounded(predicted: State, former: State, most_m: float) -> Tuple[float, ...]:
    """The covariance of a predicted State; that of the former one where the position would be less certain than this
    standard deviation."""
    return (former if predicted.position_m2 > most_m ** 2 else predicted)[4:]


def _positions_of(tracks: Iterable[Track]) -> np.ndarray:
    return np.array([(track.state.x, track.state.y, track.z_m) for track in tracks]).reshape(-1, 3)


def classify_visibility(view: CameraView, positions_m: np.ndarray, sizes_m: np.ndarray, others_m: np.ndarray,
                        max_range_m: float) -> np.ndarray:
    """Classify the visibility (n,) of people with centres and extents (n, 3) in a CameraView.

    VISIBLE: a detection is expected. OCCLUDED: by a person at one of the centres `others_m` (m, 3), which may contain
    the people themselves, or by something nearer in the depth image. OUT_OF_VIEW: also beyond the detector's range, and
    nearer than `BLIND_M` where no depth is measured.
    PRESENT: with so little of the body in the image that detectors often miss it, while its place is occupied in the
    depth image. STAYED: the same, and what occupies it is farther than the axis of the body.
    """
    distances_m, bearings = view.bearings(positions_m)
    visibility = np.full(len(positions_m), VISIBLE)
    visibility[_behind_people(distances_m, bearings, *view.bearings(others_m))] = OCCLUDED
    shares = _shares_in_image(view, positions_m, sizes_m[:, 2], bearings)
    out_of_range = _out_of_range(view, positions_m, sizes_m, distances_m, max_range_m)
    visibility[out_of_range | (shares < LEAST_IN_IMAGE)] = OUT_OF_VIEW
    undecided = np.flatnonzero((visibility != OCCLUDED) & ~out_of_range & (shares > 0))
    if view.depth_at is not None and len(undecided):
        seen = _in_depth(view, positions_m[undecided], sizes_m[undecided])
        visibility[undecided[seen.hidden & (visibility[undecided] == VISIBLE)]] = OCCLUDED
        visibility[undecided[seen.unknown & (distances_m[undecided] < BLIND_M)]] = OUT_OF_VIEW
        present = seen.present & ~seen.hidden & (shares[undecided] < RELIABLE_IN_IMAGE)
        visibility[undecided[present]] = PRESENT
        visibility[undecided[present & seen.farther]] = STAYED
    return visibility


def depths_towards(camera: Camera, depth: DepthImage, points: np.ndarray) -> np.ndarray:
    """Depth measured in the direction of points, for `CameraView.depth_at`.

    Parameters
    ----------
    camera : camera_model.Camera
    depth : images.DepthImage
    points : numpy.ndarray, (k, 3)
        In the optical frame, metres.

    Returns
    -------
    numpy.ndarray, (k,)
        Metres along z; nan for points without valid depth and points outside the image.
    """
    in_front = points[:, 2] > 0
    pixels = camera.project(np.where(in_front[:, None], points, (0, 0, 1)))
    size = np.array([camera.width, camera.height])
    inside = in_front & np.isfinite(pixels).all(axis=1)
    pixels = np.rint(np.where(inside[:, None], pixels, 0)).clip(-1, size).astype(int)
    inside &= ((pixels >= 0) & (pixels < size)).all(axis=1)
    depths_m, measured = depth.at(*np.where(inside[:, None], pixels, 0).T)
    return np.where(inside & measured, depths_m, np.nan)


def _out_of_range(view: CameraView, positions_m: np.ndarray, sizes_m: np.ndarray, distances_m: np.ndarray,
                  max_range_m: float) -> np.ndarray:
    """People too close to the camera or too far from it, (n,) bool."""
    above_m = np.abs(positions_m[:, 2] - view.fixed_from_camera[2, 3]) - sizes_m[:, 2] / 2
    distances_m = np.hypot(distances_m, np.maximum(above_m, 0))
    return (distances_m < NEAREST_M) | (distances_m > max_range_m)


def _shares_in_image(view: CameraView, positions_m: np.ndarray, heights_m: np.ndarray,
                     bearings: np.ndarray) -> np.ndarray:
    """Share (n,) of the axes of upright bodies inside the part of the image with depth, less a margin of `EDGE_RAD`,
    regardless of occlusion.

    Points for which the lens distortion defines no pixel count as outside. Without intrinsics, the image shows
    everything ahead.
    """
    if view.intrinsics is None:
        return (np.abs(bearings) <= np.pi / 2).astype(float)
    camera, rotation = view.intrinsics, view.fixed_from_camera[:3, :3]  # its inverse is its transpose
    centers = (positions_m - view.fixed_from_camera[:3, 3]).dot(rotation)
    points = centers[:, None] + (AXIS_SAMPLES * heights_m[:, None])[..., None] * rotation[2]
    in_front = points[..., 2] > 0
    points[..., 2][~in_front] = 1  # they have no pixel
    with np.errstate(invalid='ignore'):  # nan is outside
        pixels = camera.project(points)
        area_px = view.measured_area() if view.measured_area else (0, 0) + camera[:2]
        low_px, high_px = np.reshape(area_px, (2, 2)) - 0.5
        margin_px = np.multiply(EDGE_RAD, (camera.fx, camera.fy))
        inside = ((pixels >= low_px + margin_px) & (pixels <= high_px - margin_px)).all(axis=-1)
    return (in_front & inside).sum(axis=1) / len(AXIS_SAMPLES)


def _behind_people(distances_m: np.ndarray, bearings: np.ndarray, others_m: np.ndarray,
                   others_bearings: np.ndarray) -> np.ndarray:
    apart = np.abs(wrapped(others_bearings - bearings[:, None]))
    covered = apart < _half_widths(others_m) + SEEN_BESIDE * _half_widths(distances_m)[:, None]
    return (covered & (others_m < distances_m[:, None] - NEARER_M)).any(axis=1)


def _half_widths(distances_m: np.ndarray) -> np.ndarray:
    """Angular half widths of bodies at distances in metres, radians."""
    return np.arcsin(np.minimum(BODY_RADIUS_M / np.maximum(distances_m, 0.01), 1))


class _InDepth(NamedTuple):
    """What the depth image shows at the places of people, (n,) bool each.

    Most of the depth measured towards the body is clearly nearer (`hidden`) or farther than its axis (`farther`); a
    part is at its distance (`present`); or none is measured (`unknown`).
    """

    hidden: np.ndarray
    present: np.ndarray
    farther: np.ndarray
    unknown: np.ndarray


def _in_depth(view: CameraView, positions_m: np.ndarray, sizes_m: np.ndarray) -> _InDepth:
    """The _InDepth of people with centres and extents (n, 3)."""
    rotation = view.fixed_from_camera[:3, :3]  # its inverse is its transpose
    centers = (positions_m - view.fixed_from_camera[:3, 3]).dot(rotation)
    right = rotation.T.dot((view.ahead[1], -view.ahead[0], 0))
    offsets = (sizes_m[:, :1] / 2 * ACROSS.ravel())[..., None] * right
    offsets += (sizes_m[:, 2:] / 2 * ALONG.ravel())[..., None] * rotation[2]  # up
    points = centers[:, None] + offsets
    depths_m = view.depth_at(points.reshape(-1, 3)).reshape(len(centers), ACROSS.size)
    known = np.isfinite(depths_m)
    behind_m = np.where(known, points[..., 2] - depths_m, np.nan)
    with np.errstate(invalid='ignore'):  # nan is neither
        each = behind_m > HIDDEN_BEHIND_M, np.abs(behind_m) <= HIDDEN_BEHIND_M, behind_m < 0
    counts = np.maximum(known.sum(axis=1), ACROSS.size / 3.0)
    hidden, present, farther = (some.sum(axis=1) / counts for some in each)
    return _InDepth(hidden > HIDDEN_SHARE, present > PRESENT_SHARE, farther > HIDDEN_SHARE, ~known.any(axis=1))
