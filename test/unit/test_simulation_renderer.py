import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ros_3d_bb.camera.camera_model import Camera
from ros_3d_bb_lab.simulation.mesh import box
from ros_3d_bb_lab.simulation.renderer import render
from ros_3d_bb_lab.simulation.room import FLOOR, RenderedRoom
from support.people import mounted

BOUNDS, HEIGHT = (-3.0, 9.0, -4.0, 4.0), 2.8
CAMERA = Camera(160, 120, 153.7, 153.7, 79.8, 60.5)
cameras = st.sampled_from([CAMERA, Camera(161, 119, 140, 150, 70, 66), Camera(99, 133, 80, 90, 49, 60)])


def pose(position, yaw=0.0, pitch=0.0, roll=0.0):
    """Transform from the camera to the world. The camera faces x if all angles are 0."""
    matrix = mounted(0.0, *np.degrees((-pitch, roll, yaw)))
    matrix[:3, 3] = position
    return matrix


poses = st.builds(pose, st.tuples(st.floats(-2.5, 8.5), st.floats(-3.5, 3.5), st.floats(.1, 2.6)), st.floats(-4, 4),
                  st.floats(-1, 1), st.floats(-.5, .5))


@pytest.fixture(scope='module')
def room():
    return RenderedRoom(BOUNDS, HEIGHT, np.random.RandomState(3))


def crate(size, position, yaw=0.0, color=(200, 40, 40)):
    return box(size, color, np.random.RandomState(1)).moved(position, yaw)


def draw(room, meshes, camera=CAMERA, world_from_camera=pose((0, 0, 1.2)), shadows=()):
    return render(room, meshes, shadows, camera, world_from_camera)


def rays(camera, world_from_camera):
    """Rays (h, w, 3) of the pixels in the world, of length 1 along the optical axis."""
    u, v = np.meshgrid(np.arange(camera.width), np.arange(camera.height))
    return camera.deproject(np.stack([u, v], axis=-1), np.ones(u.shape)).dot(world_from_camera[:3, :3].T)


def depths_in(low, high, origin, directions):
    """Depths at which rays enter and leave an axis-aligned box, and the axis of the face through which they enter."""
    with np.errstate(divide='ignore', invalid='ignore'):
        ends = np.stack([(low - origin) / directions, (high - origin) / directions])
    entries = ends.min(axis=0)
    return entries.max(axis=-1), ends.max(axis=0).min(axis=-1), entries.argmax(axis=-1)


def everywhere(mask):
    """Pixels whose neighbourhood lies within a mask."""
    return cv2.erode(mask.astype(np.uint8), np.ones((5, 5)), borderType=cv2.BORDER_REPLICATE) > 0


@given(poses, cameras)
@settings(max_examples=25)
def test_depth_of_floor_ceiling_and_walls_agrees_with_ray_casting(room, world_from_camera, camera):
    _color, inverse_depth, surfaces = room.draw(camera, world_from_camera)
    low, high = np.array(BOUNDS[::2] + (0.0,)), np.array(BOUNDS[1::2] + (HEIGHT,))
    origin, directions = world_from_camera[:3, 3], rays(camera, world_from_camera)
    _entry, depth_m, _axis = depths_in(low, high, origin, directions)
    np.testing.assert_allclose(inverse_depth, 1 / depth_m, rtol=1e-3, atol=1e-5)
    height_m = (origin + directions * depth_m[..., None])[..., 2]
    assert (surfaces[height_m > .01] != FLOOR).all() and (surfaces[height_m < -.01 + 1e-6] == FLOOR).all()
    assert surfaces.max() <= 5


@given(cameras, st.floats(2, 6), st.floats(-1, 1), st.floats(-3, 3), st.tuples(*[st.floats(.2, 1.5)] * 3))
@settings(max_examples=25)
def test_depth_of_a_box_is_that_of_rays(room, camera, x, y, yaw, size):
    """Two pixels away from its outline and edges; nearer, it need not be."""
    world_from_camera = pose((0, 0, 1.2), .05, -.1, .03)
    drawn = draw(room, [crate(size, (x, y, 0), yaw)], camera, world_from_camera)
    c, s = np.cos(yaw), np.sin(yaw)
    into_box = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    half = np.array(size) / 2
    near, far, axis = depths_in(-half, half, (world_from_camera[:3, 3] - (x, y, half[2])).dot(into_box),
                                rays(camera, world_from_camera).dot(into_box))
    hit = near < far
    assert (drawn.objects[everywhere(hit)] == 1).all() and (drawn.objects[everywhere(~hit)] == 0).all()
    for number in range(3):
        on_side = everywhere(hit & (axis == number))
        np.testing.assert_allclose(drawn.inverse_depth[on_side], 1 / near[on_side], rtol=1e-4)
