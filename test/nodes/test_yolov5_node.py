"""yolov5_node on images of a session. Needs a master because the node works on the newest of a stream of images."""
import os
import subprocess

import numpy as np
import pytest
import rospy
import yaml
from dynamic_reconfigure.client import Client
from sensor_msgs.msg import Image
from std_msgs.msg import Int32MultiArray
from std_srvs.srv import SetBool

from ros_3d_bb.conversions.image_msgs import fill_image, imgmsg_to_rgb
from ros_3d_bb.conversions.perception_msgs import boxes2d_from_msg, stamp_of
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.detection.boxes import iou
from ros_3d_bb.sessions.session_reader import read_color, read_session
from support.ros import TIMEOUT_S, Recorder, diagnostics_of, header_at, launched, publisher, wait_until

START = 1000 * NS
CONFIG = os.path.join(os.path.dirname(os.path.abspath(__file__)), os.pardir, os.pardir, 'config', 'yolov5.yaml')


@pytest.fixture(scope='module')
def images(session_folder):
    """Three colour images with a person, the person's box in each, and the number of the session's frame."""
    session = read_session(session_folder)
    frames = [session.frames[number] for number in (15, 45, 75)]
    return [(read_color(frame, session.camera), frame.boxes_px[0]) for frame in frames]


@pytest.fixture(scope='module', params=['auto', 'torch'])
def camera(request, weights, tmp_path_factory):
    """Where to send images, with the node on each runtime."""
    with open(CONFIG) as stream:
        given = dict(yaml.safe_load(stream), runtime=request.param, threads=1)
    params = str(tmp_path_factory.mktemp('params') / 'yolov5.yaml')
    with open(params, 'w') as stream:
        yaml.safe_dump(given, stream)
    rospy.init_node('test_yolov5_node')
    with launched('yolov5.launch', 'weights:=' + weights, 'params:=' + params):
        yield publisher('camera/color/image_raw', Image)


@pytest.fixture(scope='module')
def recorder(camera):
    with Recorder('yolo_bounding_box', Int32MultiArray) as recorder:
        yield recorder


@pytest.fixture
def found(recorder):
    return recorder.emptied()


def color_message(image, stamp_ns, encoding='rgb8'):
    return fill_image(Image(header=header_at(stamp_ns)), image, encoding)


@pytest.mark.parametrize('number', range(3))
@pytest.mark.parametrize('encoding', ['rgb8', 'bgr8'])
def test_the_person_is_found_and_the_array_carries_stamp_and_frame(camera, found, images, number, encoding):
    image, box = images[number]
    camera.publish(color_message(image if encoding == 'rgb8' else image[..., ::-1], START + number, encoding))
    message, = found.wait_for(1)
    boxes = boxes2d_from_msg(message)
    assert boxes.stamp_ns == START + number and boxes.frame_id == 'camera_color_optical_frame'
    assert message.layout.dim[0].label == ('boxes;stamp=1000.%09d;frame=camera_color_optical_frame' % number)
    assert message.layout.dim[0].size == len(boxes.boxes) == 1 and message.layout.dim[1].size == 4
    assert message.layout.data_offset == 0
    assert iou(np.array(box, float), boxes.boxes)[0] > 0.8


def test_nobody_is_an_answer(camera, found):
    camera.publish(color_message(np.full((480, 640, 3), 128, np.uint8), START))
    message, = found.wait_for(1)
    assert len(message.data) == 0 and boxes2d_from_msg(message).stamp_ns == START


def test_the_service_pauses_and_resumes(camera, found, images):
    rospy.wait_for_service('yolov5_node/enable', 10)
    enable = rospy.ServiceProxy('yolov5_node/enable', SetBool)
    assert 'paused' in enable(False).message
    camera.publish(color_message(images[0][0], START))
    assert found.stays_at(0, 1.0)
    assert enable(True).success
    camera.publish(color_message(images[0][0], START + 5))
    assert boxes2d_from_msg(found.wait_for(1)[0]).stamp_ns == START + 5


def test_the_newest_image_is_searched_and_the_others_are_left_out(camera, found, images):
    """Ten times the size: searching takes far longer than sending."""
    big = [np.tile(image, (3, 3, 1)) for image, _box in images]
    for number in range(60):
        camera.publish(color_message(big[number % 3], START + number * NS // 200))
        rospy.sleep(0.005)
    wait_until(lambda: found.messages and boxes2d_from_msg(found.messages[-1]).stamp_ns == START + 59 * NS // 200,
               'the boxes of the last image')
    stamps = [boxes2d_from_msg(message).stamp_ns for message in found.messages]
    assert stamps == sorted(stamps) and len(stamps) < 60


def test_the_annotated_image_comes_while_somebody_looks(camera, found, images):
    image, box = images[1]
    with Recorder('yolo_result_out', Image) as drawn:
        camera.publish(color_message(image, START + 7))
        message, = drawn.wait_for(1)
    assert stamp_of(message) == START + 7 and message.encoding == 'rgb8'
    changed = (imgmsg_to_rgb(message) != image).any(axis=2)
    lines, columns = np.nonzero(changed)
    assert changed.any() and abs(columns.max() - box[2]) < 30 and abs(lines.max() - box[3]) < 30


def test_images_that_cannot_be_used_are_refused_and_the_next_works(camera, found, images):
    bad = color_message(images[0][0], START)
    bad.encoding = 'yuv422'
    camera.publish(bad)
    wait_until(lambda: 'yuv422' in diagnostics_of('yolov5_node')[1], 'a warning that names the encoding')
    assert found.messages == []
    camera.publish(color_message(images[0][0], START + 1))
    assert boxes2d_from_msg(found.wait_for(1)[0]).stamp_ns == START + 1


def test_changed_thresholds_work_from_the_next_image_on(camera, found, images):
    """Each with what it lets through; a class that the model has not is refused, and the confidence with it."""
    client = Client('yolov5_node', timeout=TIMEOUT_S)
    changes = [({'confidence': 1.0}, 0), ({'confidence': 0.25}, 1), ({'confidence': 1.0, 'classes': 'unicorn'}, 1),
               ({'image_size': 320}, 1)]
    for number, (change, count) in enumerate(changes):
        client.update_configuration(change)
        camera.publish(color_message(images[0][0], START + number))
        assert len(boxes2d_from_msg(found.wait_for(number + 1)[-1]).boxes) == count
    client.update_configuration({'image_size': 640})
    client.close()


@pytest.mark.parametrize('name,parameter,reason', [
    ('missing', '_weights:=/nowhere/yolov5n.pt', '/nowhere/yolov5n.pt: no such file; expected'),
    ('nothing', '_weights:=', 'no weights given'),
    ('unknown', '_confidense:=0.3', 'unknown parameter ~confidense; did you mean ~confidence')])
def test_a_node_that_cannot_start_says_why_and_exits(camera, name, parameter, reason):
    result = subprocess.run(['rosrun', 'ros_3d_bb', 'yolov5_node', '__name:=' + name, parameter],
                            stdout=subprocess.PIPE, stderr=subprocess.STDOUT, timeout=60,
                            env=dict(os.environ, PYTHONUNBUFFERED='1'))
    output = result.stdout.decode()
    assert result.returncode == 1 and reason in output and 'Traceback' not in output
