"""Body model of people: a surface lofted around a skeleton, clothes, and postures.

Convention: the body faces +x, its left is +y, z is up, the floor is z = 0. Tables are in metres for a person of
`TABLE_HEIGHT_M`. The heights of the joints are those of D. A. Winter, Biomechanics and Motor Control of Human Movement
(2009), fig. 4.1.
"""
from typing import NamedTuple, Tuple

import numpy as np

from ros_3d_bb_lab.simulation.gait import BONES, JOINTS_M, TABLE_HEIGHT_M, Posture, bone_transforms
from ros_3d_bb_lab.simulation.mesh import Mesh, loft, merged, vertex_normals

Color = Tuple[int, int, int]

# Rings of parts on the axis of the body: z, x of the centre, half depth, half width.
HEAD = ((1.525, .03, .045, .045), (1.55, .035, .062, .058), (1.585, .02, .085, .068), (1.62, .012, .095, .073),
        (1.66, .008, .098, .075), (1.70, .0, .094, .072), (1.735, -.005, .072, .056), (1.75, -.008, .035, .03))
NOSE = ((1.61, .105, .012, .018), (1.625, .105, .022, .016), (1.65, .105, .010, .010))
NECK = ((1.44, -.005, .058, .058), (1.50, 0, .053, .053), (1.56, .01, .055, .052))
HAIR = ((1.60, -.04, .068, .077), (1.65, -.032, .078, .081), (1.69, -.022, .086, .081), (1.715, -.012, .100, .078),
        (1.735, -.008, .085, .066), (1.755, -.01, .045, .038))
LONG_HAIR = ((1.44, -.058, .045, .056),) + HAIR
SHORT_HAIR = ((1.56, -.058, .045, .056),) + HAIR
# Trunk; the last column is the half width of a figure with narrow shoulders and wide hips.
TORSO = ((.905, 0, .122, .168, .176), (.95, 0, .116, .166, .172), (1.03, .005, .105, .153, .142),
         (1.12, .01, .098, .145, .128), (1.22, .005, .115, .160, .143), (1.32, 0, .120, .178, .154),
         (1.39, -.005, .103, .183, .158), (1.435, -.01, .083, .162, .140), (1.465, -.01, .063, .098, .085),
         (1.49, -.01, .053, .060, .055))
SEAT = ((.80, 0, .085, .138, .146), (.86, 0, .096, .150, .158), (.93, 0, .094, .146, .154), (1.0, 0, .08, .13, .12))
# Limbs along their bones: z, forward shift, half depth, half width.
SHOULDER_M = .056  # the widest ring of the sleeve
SLEEVE_TOP = ((1.43, 0, .037, .037), (1.41, 0, .056, .056), (1.32, 0, .053, .053), (1.20, 0, .047, .047))
SLEEVE_END = ((1.12, 0, .045, .045), (1.06, 0, .044, .044), (.97, 0, .039, .039), (.87, 0, .034, .034))
FOREARM = ((1.23, 0, .041, .041), (1.12, 0, .039, .039), (1.05, 0, .039, .039), (.96, 0, .034, .034),
           (.87, 0, .027, .027))
HAND = ((.89, 0, .026, .024), (.84, 0, .036, .020), (.78, 0, .042, .020), (.73, 0, .032, .017), (.69, 0, .016, .012))
LEG = ((.93, 0, .070, .070), (.87, 0, .094, .088), (.78, 0, .095, .087), (.65, 0, .084, .077), (.55, 0, .075, .070),
       (.50, .008, .073, .067), (.45, -.004, .071, .065), (.38, -.019, .073, .066), (.30, -.017, .070, .064),
       (.19, -.007, .064, .060), (.12, 0, .062, .059), (.09, .012, .066, .061))
# Shoe along x: x, z of the centre, half height, half width.
SHOE = ((-.09, .043, .024, .025), (-.065, .05, .046, .036), (-.015, .055, .052, .04), (.045, .045, .044, .044),
        (.115, .036, .034, .046), (.155, .029, .027, .036), (.18, .022, .016, .018))


class Build(NamedTuple):
    """Appearance of a person. Colours are RGB."""

    height_m: float = TABLE_HEIGHT_M
    girth: float = 1.0  # scales the body horizontally, 1 is slim
    hips: float = 0.0   # 0 (wide shoulders) to 1 (wide hips)
    long_hair: bool = False
    short_sleeves: bool = False
    skin: Color = (225, 180, 150)
    hair: Color = (60, 45, 35)
    shirt: Color = (30, 40, 60)
    trousers: Color = (85, 75, 60)
    shoes: Color = (45, 40, 40)


class Body(object):
    """Body of one person. `random` determines the creases in the clothes."""

    def __init__(self, build, random):
        self.build = build
        parts = list(_parts(build))
        self._scale = build.height_m / TABLE_HEIGHT_M
        vertices, faces = merged([part[:2] for part in parts])
        vertices *= self._scale
        colors = np.concatenate([np.tile(color, (len(faces), 1)) for _vertices, faces, color, _bones in parts])
        self._rest = Mesh(vertices, vertex_normals(vertices, faces), faces, colors.astype(np.uint8),
                          _tone(parts, random))
        weights = np.concatenate([_weights(vertices, bones) for vertices, _faces, _color, bones in parts])
        self._weights = weights.astype(np.float32)
        self._points = np.c_[vertices, np.ones(len(vertices))].astype(np.float32)
        self._normals = self._rest.normals.astype(np.float32)

    @property
    def width_m(self):
        """Diameter of an upright cylinder around the trunk and the shoulders. Parts of the arms are outside."""
        return 2 * (JOINTS_M['arm_l'][1] + SHOULDER_M * self.build.girth) * self._scale

    def posed(self, posture=Posture()):
        """Return the body in a posture as a Mesh, with its lowest point on the floor."""
        bones = bone_transforms(posture).astype(np.float32)
        bones[:, :, 3] *= self._scale
        skin = self._weights.dot(bones.reshape(len(BONES), 12)).reshape(-1, 3, 4)
        vertices = np.einsum('nij,nj->ni', skin, self._points)
        vertices[:, 2] -= vertices[:, 2].min()
        return self._rest._replace(vertices=vertices, normals=np.einsum('nij,nj->ni', skin[:, :, :3], self._normals))


def _parts(build):
    """Yield (vertices, faces, colour, bones) of each part. Bones: [(bone, z above which only this bone moves it)]."""
    def trunk(rings):
        z, x, depth, slim, wide = np.array(rings).T
        return np.c_[z, x, depth * build.girth, (slim + build.hips * (wide - slim)) * build.girth]

    yield _upright(trunk(TORSO), 16, 2.4) + (build.shirt, (('pelvis', 1.0), ('chest', 1.2)))
    yield _upright(trunk(SEAT), 14, 2.3) + (build.trousers, (('pelvis', 0),))
    yield _upright(NECK, 10) + (build.skin, (('chest', 1.44), ('head', 1.56)))
    yield _upright(HEAD, 18) + (build.skin, (('head', 0),))
    yield _upright(NOSE, 6) + (build.skin, (('head', 0),))
    yield _upright(LONG_HAIR if build.long_hair else SHORT_HAIR, 14) + (build.hair, (('head', 0),))
    for side, sign in (('_l', 1), ('_r', -1)):
        arm = (('forearm' + side, 1.09), ('arm' + side, 1.16))
        leg = (('shin' + side, .44), ('thigh' + side, .56))
        sleeve = SLEEVE_TOP if build.short_sleeves else SLEEVE_TOP + SLEEVE_END
        yield _limb(sleeve, ('arm', 'forearm', 'hand', 'fingertip'), sign, 10, build.girth) + (build.shirt, arm)
        if build.short_sleeves:
            yield _limb(FOREARM, ('arm', 'forearm', 'hand', 'fingertip'), sign, 8, 1) + (build.skin, arm)
        yield _limb(HAND, ('forearm', 'hand', 'fingertip'), sign, 8, 1) + (build.skin, (('forearm' + side, 0),))
        yield _limb(LEG, ('thigh', 'shin', 'foot'), sign, 12, build.girth) + (build.trousers, leg)
        yield _shoe(sign) + (build.shoes, (('foot' + side, 0),))


def _upright(rings, sides, exponent=2.1):
    z, x, depth, width = np.array(rings).T
    return loft(np.c_[x, np.zeros_like(z), z], np.c_[depth, width], exponent, sides)


def _limb(rings, joints, sign, sides, girth):
    """Tube along the bones between joints of the left side. A `sign` of -1 mirrors it to the right."""
    z, shift, depth, width = np.array(rings)[::-1].T
    line = np.array([JOINTS_M[name + '_l'] for name in joints])[::-1]
    x, y = (np.interp(z, line[:, 2], line[:, axis]) for axis in range(2))
    return loft(np.c_[x + shift, sign * y, z], np.c_[depth, width] * girth, 2.1, sides)


def _shoe(sign):
    x, z, height, width = np.array(SHOE).T
    y = np.full_like(x, sign * (JOINTS_M['foot_l'][1] + .005))
    return loft(np.c_[x, y, z], np.c_[width, height], 2.4, 10, axes=(1, 2))


def _weights(vertices, bones):
    """Skinning weights (n, bones): linear in z between a bone and the bone above."""
    weights = np.zeros((len(vertices), len(BONES)))
    if len(bones) == 1:
        weights[:, BONES.index(bones[0][0])] = 1
        return weights
    (lower, low_m), (upper, high_m) = bones
    share = np.clip((vertices[:, 2] - low_m) / (high_m - low_m), 0, 1)
    weights[:, BONES.index(upper)], weights[:, BONES.index(lower)] = share, 1 - share
    return weights


def _tone(parts, random):
    """Brightness of the vertices: creases in the clothes, shadows between the legs and in the face."""
    tones = []
    for vertices, _faces, _color, bones in parts:
        tone = 1 + .06 * random.standard_normal(len(vertices)).clip(-2, 2)
        name = bones[0][0]
        if name.startswith('shin'):
            tone -= .2 * np.exp(-(np.abs(vertices[:, 1]) / .045) ** 2)
        elif name == 'head':
            tone[:] = 1
            for sign in (1, -1):
                tone -= .45 * np.exp(-(((vertices - [.088, sign * .033, 1.652]) / [.03, .018, .013]) ** 2).sum(axis=1))
            tone -= .3 * np.exp(-(((vertices - [.095, 0, 1.585]) / [.03, .025, .010]) ** 2).sum(axis=1))
        tones.append(tone)
    return np.concatenate(tones).clip(.3, 1.2).astype(np.float32)
