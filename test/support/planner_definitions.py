"""Messages of packages of planners, which may not be installed, generated from their definitions.

Types and names of the fields are those of the .msg files in the public repositories wg-perception/people,
rst-tu-dortmund/costmap_converter, astuff/astuff_sensor_msgs (derived_object_msgs), ros-perception/vision_msgs (0.0.1
and 0.0.2, the releases for ROS 1) and ros/common_msgs (shape_msgs). `PUBLISHED_MD5` are checksums from published code.
"""
import functools
import types

import genpy.dynamic
from roslib.message import get_message_class

DEFINITIONS = {
    'people_msgs/Person': """
string name
geometry_msgs/Point position
geometry_msgs/Point velocity
float64 reliability
string[] tagnames
string[] tags""",
    'people_msgs/People': """
std_msgs/Header header
people_msgs/Person[] people""",
    'costmap_converter/ObstacleMsg': """
std_msgs/Header header
geometry_msgs/Polygon polygon
float64 radius
int64 id
geometry_msgs/Quaternion orientation
geometry_msgs/TwistWithCovariance velocities""",
    'costmap_converter/ObstacleArrayMsg': """
std_msgs/Header header
costmap_converter/ObstacleMsg[] obstacles""",
    'shape_msgs/SolidPrimitive': """
uint8 CYLINDER=3
uint8 type
float64[] dimensions
uint8 CYLINDER_HEIGHT=0
uint8 CYLINDER_RADIUS=1""",
    'derived_object_msgs/Object': """
std_msgs/Header header
uint32 id
uint8 detection_level
uint8 OBJECT_TRACKED=1
bool object_classified
geometry_msgs/Pose pose
geometry_msgs/Twist twist
geometry_msgs/Accel accel
geometry_msgs/Polygon polygon
shape_msgs/SolidPrimitive shape
uint8 classification
uint8 CLASSIFICATION_UNKNOWN=0
uint8 CLASSIFICATION_PEDESTRIAN=4
uint8 CLASSIFICATION_BIKE=5
uint8 CLASSIFICATION_CAR=6
uint8 CLASSIFICATION_TRUCK=7
uint8 CLASSIFICATION_MOTORCYCLE=8
uint8 CLASSIFICATION_OTHER_VEHICLE=9
uint8 CLASSIFICATION_SIGN=11
uint8 classification_certainty
uint32 classification_age""",
    'derived_object_msgs/ObjectArray': """
std_msgs/Header header
derived_object_msgs/Object[] objects""",
    'vision_msgs/ObjectHypothesisWithPose': """
int64 id
float64 score
geometry_msgs/PoseWithCovariance pose""",
    'vision_msgs/BoundingBox3D': """
geometry_msgs/Pose center
geometry_msgs/Vector3 size""",
    'vision_msgs/Detection3D': """
std_msgs/Header header
vision_msgs/ObjectHypothesisWithPose[] results
vision_msgs/BoundingBox3D bbox
sensor_msgs/PointCloud2 source_cloud""",
    'vision_msgs/Detection3DArray': """
std_msgs/Header header
vision_msgs/Detection3D[] detections"""}
PUBLISHED_MD5 = {'people_msgs/People': '18722f4b8db20cc2369740732357847b',
                 'costmap_converter/ObstacleArrayMsg': '8a1bdcde72c65ca7d3ce8ebf52d43516',
                 'vision_msgs/Detection3D': '7f3d8e29f3ab9853108801543aec1a5d',
                 'vision_msgs/Detection3DArray': '05c51d9aea1fb4cfdc8effb94f197b6f'}
SEPARATOR = '\n' + '=' * 80 + '\n'


def _own_text(kind):
    return DEFINITIONS[kind] if kind in DEFINITIONS else get_message_class(kind)._full_text.split(SEPARATOR)[0]


def _fields(kind):
    if kind in DEFINITIONS:
        return [line.split()[0] for line in DEFINITIONS[kind].strip().splitlines()]
    return get_message_class(kind)._slot_types


def _kinds_in(kind):
    kinds = [kind]
    for field in _fields(kind):
        if '/' in field:
            kinds += [name for name in _kinds_in(field.split('[')[0]) if name not in kinds]
    return kinds


@functools.lru_cache(maxsize=None)
def message_class(kind):
    text = SEPARATOR.join([_own_text(kind)] + ['MSG: %s\n%s' % (name, _own_text(name)) for name in _kinds_in(kind)[1:]])
    return genpy.dynamic.generate_dynamic(kind, text)[kind]


def package(name):
    return types.SimpleNamespace(**{kind.split('/')[1]: message_class(kind) for kind in DEFINITIONS
                                    if kind.startswith(name + '/')})
