"""What the simulated robot sends for one frame."""
from std_msgs.msg import Header

from ros_3d_bb.camera_messages import CameraFrame, messages_of
from ros_3d_bb.estimation import DepthImage
from ros_3d_bb.messages import time_from, tracks_to_message
from ros_3d_bb.simulation.truth import truth_at
from ros_3d_bb.stamped import NS

START_NS = 1600000000 * NS  # when scenes and bags begin: any time will do, but the same each time
TRUTH_TOPIC = 'ground_truth'
CAMERA_FRAME, MAP_FRAME, ODOM_FRAME, BASE_FRAME = 'camera_color_optical_frame', 'map', 'odom', 'base_link'


def simulated_messages(simulator, frame, stamp_ns):
    """The (topic, message) pairs of a frame: tf, camera_info, depth, colour, and the ground truth in the map."""
    stamp = time_from(stamp_ns)
    chain = [(MAP_FRAME, ODOM_FRAME, frame.poses.map_from_odom), (ODOM_FRAME, BASE_FRAME, frame.poses.odom_from_base),
             (BASE_FRAME, CAMERA_FRAME, frame.poses.base_from_camera)]
    messages = list(messages_of(CameraFrame(Header(stamp=stamp, frame_id=CAMERA_FRAME), simulator.camera, frame.color,
                                            DepthImage(frame.depth_mm, 0.001), chain)))
    truth = tracks_to_message(truth_at(simulator, frame, stamp_ns), Header(stamp=stamp, frame_id=MAP_FRAME))
    return messages + [(TRUTH_TOPIC, truth)]
