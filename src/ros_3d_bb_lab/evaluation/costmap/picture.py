"""Picture of a costmap with people: the camera image, and the costmap around the robot."""
import cv2
import numpy as np

from ros_3d_bb.camera.camera_model import transform_points
from ros_3d_bb.visualization.image_overlay import draw_boxes

VIEW_M = (-1.5, 6.5, -4.0, 4.0)  # x0, x1, y0, y1 shown, in the frame of the robot
PIXELS_M = 60  # pixels per metre
FREE, LETHAL = (245, 245, 245), (170, 30, 30)
TRUTH, ROBOT, GRID = (20, 120, 20), (40, 60, 160), (225, 225, 225)
BODY_M = 0.25
FOOTPRINT_M = np.array([[-0.254, -0.215], [-0.254, 0.215], [0.254, 0.215], [0.254, -0.215]])


def draw_costmap(path, scene, costmap):
    """Write the picture of a Costmap of a Scene; the suffix of the file selects its format.

    Red cells are lethal. Green circles are the true positions of people, with their velocities.
    """
    view = _top_view(scene, costmap)
    number = int(round(costmap.time_s * scene.simulator.rate))
    step = scene.steps[min(number, len(scene.steps) - 1)]
    image = draw_boxes(scene.simulator.frame(step.frame.number).color.copy(), np.rint(step.boxes).astype(int),
                       [''] * len(step.boxes))
    scale = view.shape[0] / image.shape[0]
    image = cv2.resize(image, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
    cv2.imwrite(path, np.hstack((image, view))[..., ::-1])


def _top_view(scene, costmap):
    """The costmap around the robot, which looks up; (h, w, 3), uint8 RGB."""
    x0, x1, y0, y1 = VIEW_M
    rows, columns = int((x1 - x0) * PIXELS_M), int((y1 - y0) * PIXELS_M)
    poses = scene.simulator.poses_at(costmap.time_s)
    map_from_robot = poses.map_from_odom.dot(poses.odom_from_base)
    ahead_m, left_m = np.meshgrid(x1 - (np.arange(rows) + 0.5) / PIXELS_M, y1 - (np.arange(columns) + 0.5) / PIXELS_M,
                                  indexing='ij')
    places_m = transform_points(map_from_robot, np.stack((ahead_m, left_m, 0 * ahead_m), axis=-1).reshape(-1, 3))
    lethal = (costmap.is_lethal(places_m[:, :2]) == 1).reshape(rows, columns)
    view = np.full((rows, columns, 3), FREE, np.uint8)
    for metres in range(int(np.ceil(x0)), int(x1) + 1):
        cv2.line(view, _pixel((metres, y0)), _pixel((metres, y1)), GRID)
    for metres in range(int(np.ceil(y0)), int(y1) + 1):
        cv2.line(view, _pixel((x0, metres)), _pixel((x1, metres)), GRID)
    view[lethal] = LETHAL
    cv2.fillPoly(view, [np.array([_pixel(corner) for corner in FOOTPRINT_M])], ROBOT, cv2.LINE_AA)
    cv2.arrowedLine(view, _pixel((0, 0)), _pixel((0.6, 0)), ROBOT, 3, cv2.LINE_AA)
    robot_from_map = np.linalg.inv(map_from_robot)
    now_m, later_m = (transform_points(robot_from_map, np.c_[positions_m, np.zeros(len(positions_m))])
                      for positions_m in (scene.simulator.positions_at(costmap.time_s),
                                          scene.simulator.positions_at(costmap.time_s + 0.5)))
    for person_m, next_m in zip(now_m, later_m):
        cv2.circle(view, _pixel(person_m), int(BODY_M * PIXELS_M), TRUTH, 2, cv2.LINE_AA)
        cv2.line(view, _pixel(person_m), _pixel(next_m), TRUTH, 2, cv2.LINE_AA)
    return view


def _pixel(place_m):
    """Pixel (column, row) of a place (x ahead, y left)."""
    return int(round((VIEW_M[3] - place_m[1]) * PIXELS_M)), int(round((VIEW_M[1] - place_m[0]) * PIXELS_M))
