"""ROS messages of one frame of the simulator."""
from std_msgs.msg import Header

from ros_3d_bb.camera.depth_image import DepthImage
from ros_3d_bb.conversions.camera_msgs import TF_TOPIC, CameraFrame, frame_id_of, messages_of, topic_of
from ros_3d_bb.conversions.perception_msgs import time_from, tracks_to_msg

TRUTH_TOPIC = 'ground_truth'
MAP_FRAME, ODOM_FRAME, BASE_FRAME = 'map', 'odom', 'base_link'


def simulated_messages(simulator, frame, stamp_ns):
    """Convert a frame to (topic, message) pairs: tf, camera_info, depth, colour, and ground truth in the map.

    The occlusion status in the ground truth refers to the camera of the frame.
    """
    stamp, frame_id = time_from(stamp_ns), frame_id_of(frame.camera)
    chain = [(MAP_FRAME, ODOM_FRAME, frame.poses.map_from_odom), (ODOM_FRAME, BASE_FRAME, frame.poses.odom_from_base),
             (BASE_FRAME, frame_id, frame.poses.base_from_camera)]
    taken = CameraFrame(Header(stamp=stamp, frame_id=frame_id), simulator.camera, frame.color,
                        DepthImage(frame.depth_mm, 0.001), chain)
    messages = [(topic_of(frame.camera, topic) if topic != TF_TOPIC else topic, message)
                for topic, message in messages_of(taken)]
    truth = tracks_to_msg(simulator.true_tracks(frame, stamp_ns), Header(stamp=stamp, frame_id=MAP_FRAME))
    return messages + [(TRUTH_TOPIC, truth)]
