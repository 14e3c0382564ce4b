"""Simulated views of people in several postures, among furniture and each other, from several mounts of a camera."""
from typing import Any, Iterator, List, NamedTuple, Sequence, Tuple

import numpy as np

from ros_3d_bb.camera.camera_model import Camera, transform_points
from ros_3d_bb.camera.images import DepthImage
from ros_3d_bb.estimation.box3d_estimator import estimate_boxes, estimator_named, level_rotation
from ros_3d_bb_lab.simulation.scenario import scenario_from
from ros_3d_bb_lab.simulation.simulator import Simulator

MOUNTS = (0.27, 0), (0.6, 0), (0.9, 0), (1.3, 0), (1.3, 15), (2.35, 28)  # height, metres; tilt, degrees
FURNITURE_M = (0.7, 1.4, 0.74), (0.3, 0.5, 0.7), (0.6, 1.2, 0.95)  # a table, a chest, a counter
POSTURES = {}, {}, {'lift_l': 1.57}, {'lift_r': 2.9}, {'bend': 0.7}, {'crouch': 0.6}, {'lift_l': 0.5, 'lift_r': 0.8}
SCENES, IMAGES = 36, 4  # images of each scene
LEAST_VISIBLE, SCATTER = 0.25, 0.02  # of people with boxes; standard deviation of edges, relative to the box
FAR_M = 0.3


class View(NamedTuple):
    """A depth image, and the rectangles and true positions in the optical frame of its people."""

    depth: DepthImage
    camera: Camera
    up: np.ndarray  # unit vector in the optical frame
    rects_px: List[tuple]
    positions_m: List[np.ndarray]


def simulated_views() -> Iterator[View]:
    for seed in range(SCENES):
        random = np.random.RandomState(seed)
        height_m, tilt_deg = MOUNTS[seed % len(MOUNTS)]
        furniture = [{'at': _place(random), 'size': list(FURNITURE_M[random.randint(len(FURNITURE_M))])}
                     for _ in range(random.randint(1, 4))]
        people = [{'start': [3.0, number], 'height': random.uniform(1.5, 1.95)}
                  for number in range(random.randint(2, 5))]
        simulator = simulator_of(people, height_m, tilt_deg, seed=seed, furniture=furniture,
                                 wall_m=random.uniform(5.5, 9.5))
        for _ in range(IMAGES):
            yield _view(simulator, random)


def simulator_of(people: Sequence[dict], height_m: float, tilt_deg: float = 0, seconds: float = 0.2, rate: float = 5.0,
                 seed: int = 0, furniture: Sequence[dict] = (), wall_m: float = 14.0) -> Simulator:
    """A Simulator of people and furniture before a wall, seen from a camera at a height."""
    robot = {'mount': [0.0, 0.0, height_m - 0.065], 'pitch': np.radians(tilt_deg)}
    room = {'bounds': [-4.0, wall_m, -7.0, 7.0], 'height': 4.0, 'furniture': list(furniture)}
    return Simulator(scenario_from({'duration': seconds, 'rate': rate, 'seed': seed, 'robot': robot, 'people': people,
                                    'room': room}))


def detected_boxes(frame: Any, camera: Camera, random: np.random.RandomState, least_visible: float,
                   scatter: float) -> Tuple[List[Any], List[tuple]]:
    """Visible people and their 2D boxes as a detector draws them; `scatter` is the standard deviation of their edges,
    relative to the box."""
    people = [person for person in frame.people if person.box_px is not None and person.visible >= least_visible]
    boxes_px = np.array([person.box_px for person in people], float).reshape(-1, 4)
    extents_px = np.tile(boxes_px[:, 2:] - boxes_px[:, :2], 2)
    boxes_px += random.normal(0, scatter, boxes_px.shape) * extents_px
    boxes_px = np.rint(np.clip(boxes_px, 0, [camera.width, camera.height] * 2)).astype(int)
    return people, [tuple(box_px) for box_px in boxes_px.tolist()]


def _place(random: np.random.RandomState) -> List[float]:
    ahead_m = random.uniform(1.2, 5.0)
    return [ahead_m, random.uniform(-0.4, 0.4) * ahead_m]


def _view(simulator: Simulator, random: np.random.RandomState) -> View:
    """A View of the people of a simulator at other places, often one behind the other."""
    state, people = simulator.state_at(0), []
    for person in state.people:
        posture = person.posture._replace(**POSTURES[random.randint(len(POSTURES))])
        behind_m = [random.uniform(0.6, 1.5), random.uniform(-0.4, 0.4)]
        place_m = people[0].position_m + behind_m if people and random.rand() < 0.6 else np.array(_place(random))
        people.append(person._replace(position_m=place_m, heading_rad=random.uniform(-3, 3), posture=posture))
    frame = simulator.frame(0, state._replace(people=people))
    camera_from_map = np.linalg.inv(frame.poses.map_from_camera)
    seen, rects_px = detected_boxes(frame, simulator.camera, random, LEAST_VISIBLE, SCATTER)
    return View(DepthImage(frame.depth_mm, 0.001), simulator.camera, camera_from_map[:3, 2], rects_px,
                [transform_points(camera_from_map, person.position_m) for person in seen])


def scores_of_views(views: List[View]) -> dict:
    """Errors in the level plane; the number of people who are farther than `FAR_M` from their box, and without one."""
    errors_m, missed = [], 0
    for view in views:
        boxes = estimate_boxes(view.depth, view.rects_px, view.camera, estimator_named('foreground'),
                               level_rotation(view.up))
        for box, position_m in zip(boxes, view.positions_m):
            missed += not box.is_plausible
            if box.is_plausible:
                error_m = box.center_m - position_m
                errors_m.append(np.linalg.norm(error_m - view.up.dot(error_m) * view.up))
    return {'median_m': float(np.median(errors_m)), 'p90_m': float(np.percentile(errors_m, 90)),
            'far': int(np.count_nonzero(np.array(errors_m) > FAR_M)), 'missed': missed}
