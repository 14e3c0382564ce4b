"""Objects other than people: their shapes, made of boxes, and the motion of an object that a person pushes.

Convention: an object faces +x, its left is +y, z is up, the floor is z = 0; its footprint is centred at the origin.
"""
from typing import NamedTuple

import numpy as np

from ros_3d_bb_lab.simulation.mesh import Mesh, box, merged
from ros_3d_bb_lab.simulation.motion import State

GAP_M = 0.4  # from the axis of a person to the object in front of them
STEP_S = 0.01  # for velocities


class Part(NamedTuple):
    """A box of an object: its extents, and the middle of its lower side; metres."""

    size_m: tuple
    at_m: tuple


def _legs(size_m, apart_m):
    return tuple(Part(size_m, (x * apart_m[0] / 2, y * apart_m[1] / 2, 0)) for x in (-1, 1) for y in (-1, 1))


SHAPES = {
    'dog': _legs((0.06, 0.06, 0.25), (0.48, 0.16)) + (Part((0.55, 0.24, 0.24), (-0.02, 0, 0.24)),
                                                      Part((0.2, 0.15, 0.2), (0.25, 0, 0.38)),
                                                      Part((0.06, 0.05, 0.05), (-0.32, 0, 0.42))),
    'chair': (Part((0.45, 0.45, 0.45), (0, 0, 0)), Part((0.1, 0.45, 0.45), (-0.175, 0, 0.45))),
    'trolley': (Part((0.6, 0.45, 0.8), (0, 0, 0.08)), Part((0.04, 0.45, 1.0), (-0.28, 0, 0)))}
COLORS = {'dog': (120, 85, 50), 'chair': (70, 90, 140), 'trolley': (150, 155, 160)}
OTHER_COLOR = (160, 120, 90)


def object_mesh(scene_object, random):
    """Mesh of a `scenario.SceneObject`: the shape of its class, or one box if it has a size.

    `random` mottles the sides.
    """
    one_box = scene_object.size and (Part(scene_object.size, (0, 0, scene_object.above)),)
    parts = one_box or SHAPES[scene_object.label]
    color = scene_object.color or COLORS.get(scene_object.label, OTHER_COLOR)
    meshes = [box(part.size_m, color, random).moved(part.at_m, 0) for part in parts]
    vertices, faces = merged([(mesh.vertices, mesh.faces) for mesh in meshes])
    normals, colors, tone = (np.concatenate([getattr(mesh, name) for mesh in meshes])
                             for name in ('normals', 'colors', 'tone'))
    return Mesh(vertices, normals, faces, colors, tone)


class PushedMotion(object):
    """Motion of an object in front of a person, at `distance_m` from the axis of the person, towards the heading.

    `person` is the `motion.Motion` of the person.
    """

    def __init__(self, person, distance_m):
        self._person, self._distance_m = person, distance_m

    def at(self, time_s):
        before, now, after = (self._place(time_s + shift_s) for shift_s in (-STEP_S, 0, STEP_S))
        state = self._person.at(time_s)
        return State(now, (after - before) / (2 * STEP_S), state.heading_rad, state.posture)

    def _place(self, time_s):
        state = self._person.at(time_s)
        return state.position_m + self._distance_m * np.array([np.cos(state.heading_rad), np.sin(state.heading_rad)])
