"""The pipeline on the bag of a measurement session. Needs a master and the clock of the bag."""
import numpy as np
import pytest
from visualization_msgs.msg import Marker, MarkerArray

from ros_3d_bb.bags.bag_writer import write_bag
from ros_3d_bb.conversions.camera_msgs import START_NS
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.msg import BoundingBox3DArray, TrackedObjectArray
from ros_3d_bb.sessions.session_reader import read_session
from support.bags import MOUNT_M, session_images
from support.ros import Recorder, launched


@pytest.mark.parametrize('single_process', ['true', 'false'])
def test_playback_tracks_the_person_in_the_map(single_process, session_folder, weights, tmp_path):
    """From the images of a session alone, with the detector.

    The person jumps every five images: a new track starts, or the old one needs some images to follow.
    """
    session, path, rate_hz = read_session(session_folder), str(tmp_path / 'session.bag'), 10.0
    write_bag(session_images(session, rate_hz, with_boxes=True), path)
    frames = {START_NS + int(number * NS / rate_hz): frame for number, frame in enumerate(session.frames)}
    with Recorder('ros_3d_bb/bb_3d', BoundingBox3DArray, False) as boxes, \
            Recorder('ros_3d_bb/tracks', TrackedObjectArray, False) as tracks, \
            Recorder('visualization_marker_array', MarkerArray, False) as markers, \
            launched('playback.launch', 'bag:=' + path, 'weights:=' + weights, 'rviz:=false', 'exit_at_end:=true',
                     'delay:=20', 'single_process:=' + single_process) as process:
        process.wait()
    assert len(boxes.messages) > len(frames) / 2
    assert all(message.header.stamp.to_nsec() in frames for message in boxes.messages + tracks.messages)
    assert all(message.header.frame_id == session.frame_id for message in boxes.messages)
    assert all(message.header.frame_id == 'map' for message in tracks.messages)
    errors_m = []
    for message in tracks.messages:
        right, _down, ahead = frames[message.header.stamp.to_nsec()].estimate_m
        for person in message.objects:
            if person.last_seen == message.header.stamp:
                position = person.pose.pose.position
                errors_m.append(np.hypot(position.x - (ahead + MOUNT_M[0]), position.y + right))
    assert len(errors_m) > len(tracks.messages) * 0.25 and np.percentile(errors_m, 80) < 0.3
    assert all(message.objects[0].id >= 1 for message in tracks.messages if message.objects)
    drawn = set(marker.ns for message in markers.messages for marker in message.markers if marker.action == Marker.ADD)
    assert drawn == {'cylinder', 'id', 'velocity', 'prediction', 'history', 'ellipse', 'field_of_view'}
