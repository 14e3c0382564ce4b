"""Skeleton, and its postures while walking, standing and crouching.

Convention: as in `body`, the skeleton faces +x, its left is +y, z is up; metres for a person of `TABLE_HEIGHT_M`,
angles in radians.
"""
from typing import NamedTuple

import numpy as np

from ros_3d_bb_lab.simulation.mesh import rotation

TABLE_HEIGHT_M = 1.75
PARENTS = (('pelvis', None), ('chest', 'pelvis'), ('head', 'chest'),
           ('arm_l', 'chest'), ('forearm_l', 'arm_l'), ('thigh_l', 'pelvis'), ('shin_l', 'thigh_l'),
           ('foot_l', 'shin_l'), ('arm_r', 'chest'), ('forearm_r', 'arm_r'), ('thigh_r', 'pelvis'),
           ('shin_r', 'thigh_r'), ('foot_r', 'shin_r'))
BONES = [name for name, _parent in PARENTS]
# Proximal joint of each bone; the hand and the fingertip belong to the forearm.
JOINTS_M = {'pelvis': (0, 0, .95), 'chest': (0, 0, 1.12), 'head': (-.01, 0, 1.50),
            'arm_l': (-.005, .175, 1.41), 'forearm_l': (-.02, .225, 1.12), 'hand_l': (.04, .243, .87),
            'fingertip_l': (.06, .241, .69), 'thigh_l': (0, .085, .93), 'shin_l': (.01, .09, .50),
            'foot_l': (-.015, .095, .09)}
JOINTS_M.update({name[:-1] + 'r': (x, -y, z) for name, (x, y, z) in JOINTS_M.items() if name.endswith('_l')})

# Flexion of hip, knee and ankle at tenths of a gait cycle that begins with heel strike, in degrees: normal walking in
# J. Perry, Gait Analysis (1992), changed by up to 12 degrees, because the rigid shoes of the model would slide over the
# floor otherwise. The stride is 0.67 body heights.
CYCLE = np.linspace(0, 1, 11)
HIP = np.radians([24, 22, 16, 5, -5, -12, -15, 8, 26, 30, 24])
KNEE = np.radians([5, 15, 18, 14, 9, 14, 43, 63, 49, 18, 5])
ANKLE = np.radians([1, -3, -1, 3, 8, 16, -12, -4, 2, 2, 1])
ARM_SWING, ELBOW = 0.42, 0.18
STANCE = 0.5  # stance phase of one foot as a share of the cycle
X, Y, Z = range(3)
# Deep crouch: flexion of hip, knee and ankle, and inclination of the chest.
CROUCH = np.radians([105, 130, 25, 20])


class Posture(NamedTuple):
    """Posture while walking, standing or crouching. Angles of limbs are relative to those of a standing body."""

    phase: float = 0.0   # of the gait, in cycles since left heel strike
    swing: float = 0.0   # 0 (standing) to 1 (walking)
    crouch: float = 0.0  # 0 to 1
    lift_l: float = 0.0  # of the left arm, sideways; pi points it upwards
    lift_r: float = 0.0
    reach: float = 0.0   # of both arms, ahead
    bend: float = 0.0    # of the chest, ahead


def bone_transforms(posture):
    """Rigid transforms (bones, 3, 4) of the bones from the standing body to a posture.

    The feet of a standing body are below the origin, those of a crouching body within 12 cm of it. The height above the
    floor is arbitrary.
    """
    turns = _joint_turns(posture)
    transforms = {None: np.eye(4)}
    for name, parent in PARENTS:
        joint = np.array(JOINTS_M[name])
        turn = np.eye(4)
        turn[:3, :3] = turns[name]
        turn[:3, 3] = joint - turns[name].dot(joint)
        transforms[name] = transforms[parent].dot(turn)
    result = np.stack([transforms[name][:3] for name in BONES])
    soles_x = [transforms['foot_' + side][0].dot([.04, 0, 0, 1]) for side in 'lr']
    result[:, 0, 3] -= posture.crouch * np.mean(soles_x)
    return result


def stride_m(height_m, swing=1.0):
    """Length of one gait cycle: the distance that the foot moves back during stance, divided by `STANCE`."""
    def ankle_x(phase):
        foot = bone_transforms(Posture(phase, swing))[BONES.index('foot_l')]
        return foot.dot(np.append(JOINTS_M['foot_l'], 1))[0]

    return (ankle_x(0) - ankle_x(STANCE)) / STANCE * height_m / TABLE_HEIGHT_M


def _joint_turns(posture):
    swing, crouch = posture.swing, posture.crouch
    twist = .10 * swing * np.cos(2 * np.pi * posture.phase)
    turns = {'pelvis': rotation(Z, -twist),
             'chest': rotation(Z, 1.2 * twist).dot(rotation(Y, .03 * swing + CROUCH[3] * crouch + posture.bend)),
             'head': rotation(Z, -.3 * twist).dot(rotation(Y, -.7 * CROUCH[3] * crouch))}
    for side, offset, sign, lift in (('_l', 0, 1, posture.lift_l), ('_r', .5, -1, posture.lift_r)):
        phase = (posture.phase + offset) % 1
        hip, knee, ankle = (swing * (1 - crouch) * np.interp(phase, CYCLE, curve) + crouch * bend
                            for curve, bend in zip((HIP, KNEE, ANKLE), CROUCH))
        turns['thigh' + side] = rotation(Y, -hip).dot(rotation(X, -.03 * sign))
        turns['shin' + side] = rotation(Y, knee)
        turns['foot' + side] = rotation(Y, -ankle)
        arm = ARM_SWING * swing * np.cos(2 * np.pi * phase) - .5 * crouch - posture.reach
        turns['arm' + side] = rotation(Y, arm).dot(rotation(X, (.03 + lift) * sign))
        elbow = ELBOW * (1 + swing * max(0, np.sin(2 * np.pi * phase)))
        turns['forearm' + side] = rotation(Y, -elbow - .8 * crouch)
    return turns
