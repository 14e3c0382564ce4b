"""What realsense_node publishes of a recording, and of a camera that is disconnected."""
import contextlib

import numpy as np
import pytest
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import CameraInfo, Image
from tf2_msgs.msg import TFMessage

from ros_3d_bb.conversions.camera_msgs import COLOR_TOPIC as COLOR, DEPTH_TOPIC as DEPTH, INFO_TOPICS
from support.realsense_recordings import FRAMES, SKIPPED, START_MS, STEP_MS
from support.ros import Recorder, started

IMAGE_TOPICS = dict({COLOR: Image, DEPTH: Image}, **{topic: CameraInfo for topic in INFO_TOPICS})
TOPICS = dict({'/tf_static': TFMessage, '/clock': Clock}, **IMAGE_TOPICS)


@pytest.fixture(scope='module')
def played(recording):
    """{topic: messages} of a recording that was played once; again if librealsense lost images on a busy machine."""
    for _attempt in range(3):
        with contextlib.ExitStack() as stack:
            recorders = {topic: stack.enter_context(Recorder(topic, kind, publisher_expected=False))
                         for topic, kind in TOPICS.items()}
            process = started('realsense_node', 'file:=' + recording, 'publish_clock:=true', 'real_time:=false',
                              'wait_for_subscribers:=1')
            output, _none = process.communicate(timeout=60)
            assert process.returncode == 0, output
            if all(len(recorders[topic].messages) >= FRAMES - SKIPPED for topic in IMAGE_TOPICS):
                break
    return {topic: recorder.messages for topic, recorder in recorders.items()}


def test_all_messages_of_a_frame_have_one_stamp(played):
    skipped = FRAMES - len(played[COLOR])
    assert 0 <= skipped <= SKIPPED
    expected = [(START_MS + number * STEP_MS) / 1000 for number in range(skipped, FRAMES)]
    for topic in IMAGE_TOPICS:
        headers = [message.header for message in played[topic]]
        np.testing.assert_allclose([header.stamp.to_sec() for header in headers], expected, atol=1e-6)
        assert [header.stamp for header in headers] == [message.header.stamp for message in played[COLOR]]
        assert set(header.frame_id for header in headers) == {'camera_color_optical_frame'}
    clocks = [message.clock for message in played['/clock'][-len(expected):]]
    assert clocks == [image.header.stamp for image in played[COLOR]]
