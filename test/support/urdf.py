"""Where links of a robot's description are."""
import numpy as np

from ros_3d_bb.camera.camera_model import transform_from


def parent_from_child(joint):
    """The 4x4 transform of a URDF joint; rpy are rotations about the fixed axes x, y, z in this order."""
    origin = joint.find('origin')
    xyz, rpy = ([float(value) for value in (origin.get(key, '0 0 0') if origin is not None else '0 0 0').split()]
                for key in ('xyz', 'rpy'))
    roll, pitch, yaw = (transform_from((0, 0, 0), np.append(np.sin(angle / 2) * axis, np.cos(angle / 2)))
                        for angle, axis in zip(rpy, np.eye(3)))
    return transform_from(xyz, (0, 0, 0, 1)).dot(yaw).dot(pitch).dot(roll)


def base_from(frame, description):
    """The 4x4 transform from a link to base_link. KeyError where no joint holds it."""
    joints = {joint.find('child').get('link'): joint for joint in description.findall('joint')}
    transform = np.eye(4)
    while frame != 'base_link':
        transform = parent_from_child(joints[frame]).dot(transform)
        frame = joints[frame].find('parent').get('link')
    return transform
