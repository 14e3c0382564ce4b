"""The pipeline with camera_pose:=floor, on images of a rolled camera without tf. Needs a master because a static
transform reaches the other nodes through it.
"""
import numpy as np
import rospy
from sensor_msgs.msg import CameraInfo, Image

from ros_3d_bb.conversions.camera_msgs import COLOR_TOPIC, DEPTH_TOPIC, INFO_TOPICS
from ros_3d_bb.conversions.perception_msgs import tracks_from_msg
from ros_3d_bb.msg import TrackedObjectArray
from support.ros import Recorder, publisher
from support.rolled_camera import RolledSimulator


def test_people_are_tracked_above_the_floor_that_is_seen():
    rospy.init_node('test_camera_pose_node')
    simulator = RolledSimulator()
    frames = [simulator.frame(number) for number in range(simulator.frame_count)]
    pubs = {topic: publisher(topic, kind) for topic, kind in (
        (INFO_TOPICS[0], CameraInfo), (DEPTH_TOPIC, Image), (COLOR_TOPIC, Image))}
    tracks, truth_m = Recorder('ros_3d_bb/tracks', TrackedObjectArray), {}
    start_ns, rate = rospy.get_rostime().to_nsec(), rospy.Rate(10)
    for frame in frames + frames[::-1]:
        stamp_ns, messages = simulator.messages(frame._replace(time_s=len(truth_m) / 10.0), start_ns)
        truth_m[stamp_ns] = np.array([person.position_m[:2] for person in frame.people])
        for topic, message in messages:
            if topic in pubs:
                pubs[topic].publish(message)
        rate.sleep()
    tracks.wait_for(1)
    last = tracks.messages[-1]
    assert last.header.frame_id == 'map'
    tracks_m = np.array([track.position_m[:2] for track in tracks_from_msg(last)])
    apart_m = np.linalg.norm(tracks_m[:, None] - truth_m[last.header.stamp.to_nsec()], axis=2)
    assert apart_m.shape == (3, 3) and apart_m.min(axis=0).max() < 0.2
