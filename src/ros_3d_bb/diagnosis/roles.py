"""Topics of the pipeline and their roles."""
from ros_3d_bb.conversions.camera_msgs import COLOR_TOPIC, DEPTH_TOPIC, INFO_TOPICS
from ros_3d_bb.conversions.perception_msgs import BOXES3D_TOPIC, BOXES_TOPIC, TRACKS_TOPIC
from ros_3d_bb.diagnosis.observations import IMAGE, Role

COLOR, DEPTH, INFO, BOXES2D, BOXES3D, TRACKS = 'color', 'depth', 'info', 'boxes2d', 'boxes3d', 'tracks'
IMAGES = COLOR, DEPTH, INFO
CAMERA = 'the camera (roslaunch ros_3d_bb realsense.launch)'
CAMERA_SILENT = 'is the camera plugged in, the bag still playing (not paused), the network fast enough for images?'
DETECTOR_SILENT = ('is the detector paused (call its service ~enable with true), still loading its weights, or '
                   'configured to publish no empty arrays (publish_empty: false)?')
ROLES = {
    COLOR: Role('colour images', COLOR_TOPIC, IMAGE, 'camera_image', CAMERA, CAMERA_SILENT),
    DEPTH: Role('depth images', DEPTH_TOPIC, IMAGE, 'camera_depth', CAMERA, CAMERA_SILENT),
    INFO: Role('camera_info', INFO_TOPICS[0], 'sensor_msgs/CameraInfo', 'camera_info', CAMERA, CAMERA_SILENT),
    BOXES2D: Role('2D boxes', BOXES_TOPIC, 'std_msgs/Int32MultiArray', 'bb_topic',
                  'a detector (pipeline.launch, without detector:=none)', DETECTOR_SILENT),
    BOXES3D: Role('3D boxes', BOXES3D_TOPIC, 'ros_3d_bb/BoundingBox3DArray', '', 'bbox3d_node (pipeline.launch)',
                  'see its log'),
    TRACKS: Role('tracks', TRACKS_TOPIC, 'ros_3d_bb/TrackedObjectArray', '', 'tracker_node (pipeline.launch)',
                 'see its log')}


def role_named(name, kind):
    """Return the Role of a topic by its name in the nodes; a generic Role for topics outside the pipeline."""
    other = Role(kind, name, kind, '', 'its publisher', 'check its publisher')
    return next((role for role in ROLES.values() if role.name == name), other)


def needed_images(seen):
    """The keys of the streams of the camera that process_bag or the nodes need: a bag with 2D boxes needs no colour."""
    needs_no_color = seen.is_bag and seen.streams[BOXES2D].count and not seen.streams[COLOR].count
    return (DEPTH, INFO) if needs_no_color else IMAGES
