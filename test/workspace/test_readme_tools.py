"""Each command of the README and of doc/ that ends by itself, on little data."""
import json
import os
import re
import shutil

import pytest
import rosbag
import yaml
from sensor_msgs.msg import Image
from std_msgs.msg import Int32MultiArray, MultiArrayDimension

from ros_3d_bb.conversions.camera_msgs import COLOR_TOPIC, DEPTH_TOPIC, INFO_TOPICS, STATIC_TOPIC, TF_TOPIC
from ros_3d_bb.conversions.perception_msgs import boxes2d_from_msg, time_from
from ros_3d_bb.core.yaml_loader import load_yaml
from ros_3d_bb.detection.onnx.model_settings import ModelSettings, settings_from
from support.code_blocks import claimed
from support.onnx_files import outputs_of, write_constant_network

DEMO_AND_TESTS = claimed('./run demo\n./run test')
BUILD = claimed('./run build')
DEMO = claimed('./run demo weights:=')
ARGUMENTS = claimed('roslaunch --ros-args')
SAMPLE_BAG = claimed('cd && rosrun ros_3d_bb scenario_to_bag')
RECORD = claimed('rosbag record -O my.bag ')
PROCESS_BAG = claimed('rosrun ros_3d_bb process_bag some.bag')
TRACKS_TO_CSV = claimed('rosrun ros_3d_bb scene_report result.bag --csv')
PROCESS_BAGS, ARRAY_JOB = claimed('mkdir -p results'), claimed('bags=(day1/*.bag)')
SESSION_TO_BAG = claimed('rosrun ros_3d_bb session_to_bag')
SCENARIO_TO_BAG = claimed('rosrun ros_3d_bb scenario_to_bag')
CAMPAIGN = claimed('annotator/annotator --export')
STAMPED = claimed('message = Int32MultiArray', 'python')
# Options that shorten a benchmark.
BENCHMARKS = [(claimed('./run bench accuracy --boxes'), ''), (claimed('./run bench scenes'), ''),
              (claimed('./run bench speed\n'), ' --images 1')]
DETECTORS = claimed('./run bench detector')
MODEL_SETTINGS = [claimed('# %s.yaml' % name, 'yaml') for name in (
    'yolo11n', 'people_yolov7', 'yolox_legacy', 'nanodet', 'picodet_s_416', 'with_nms')]


@pytest.fixture(scope='module')
def clone(reader):
    """The clone of the repository, with short scenes."""
    scenarios = reader.clone / 'config' / 'scenarios'
    for path in scenarios.glob('*.yaml'):
        if path.name not in ('demo.yaml', 'thesis_a_start.yaml'):
            path.unlink()
            continue
        scene = yaml.safe_load(path.read_text())
        path.write_text(yaml.safe_dump(dict(scene, duration=3.0, rate=4.0)))
    return reader.clone


@pytest.fixture(scope='module')
def data(reader, session_folder):
    """ROS_3D_BB_DATA with a part of the session."""
    session = reader.home / 'data' / 'data' / 'thesis'
    session.mkdir(parents=True)
    with open(os.path.join(session_folder, 'frames.json')) as stream:
        content = json.load(stream)
    content['frames'] = content['frames'][::8]
    (session / 'frames.json').write_text(json.dumps(content))
    for name in ('color', 'depth'):
        os.symlink(os.path.join(session_folder, name), str(session / name))
    return str(reader.home / 'data')


def test_demo_writes_table_image_and_bag_and_the_tests_start(reader, clone):
    """Without the archives of the planners, which `./run test` would build, in some minutes."""
    printed = reader.types(DEMO_AND_TESTS, clone, ROS_3D_BB_DATA='')
    assert 'people are found by depth' in printed and 'running all tests' in printed
    for kind in ('bag', 'png'):
        path, = re.findall(r'(/\S+\.%s)' % kind, printed.split('what became of it')[1])[:1]
        assert os.path.exists(path)
    assert 'run_tests -j2' in reader.log.read_text()


def test_demo_with_weights(reader, clone, weights):
    assert re.search(r'people are found by /.*/%s' % os.path.basename(weights), reader.types(DEMO, clone))


def test_build_prints_the_path_of_this_checkout(reader, clone):
    printed = reader.types(BUILD, clone, replaced=[('~/.cache/ros_3d_bb', str(reader.cache))],
                           appended='\nprintf "%s\n" "$ROS_PACKAGE_PATH"')
    own, = re.findall(r'source (%s/workspace-\w+)/devel/setup.bash\n' % reader.cache, printed)
    assert printed.rstrip().endswith('%s/src' % own)


def test_the_arguments_are_listed(reader):
    listed = set(re.findall(r'^\s+(\w+)(?: \(default .*\))?: ', reader.types(ARGUMENTS), re.MULTILINE))
    assert {'detector', 'weights', 'error_model', 'frame_world', 'planner'} <= listed


def test_the_recorded_topics_are_the_inputs():
    assert RECORD.text.split()[4:] == ['/' + topic for topic in (  # rosbag stores them as given
        COLOR_TOPIC, INFO_TOPICS[0], DEPTH_TOPIC, TF_TOPIC, STATIC_TOPIC)]


def test_one_or_many_bags_are_processed(reader, camera_bag):
    (reader.home / 'day1').mkdir()
    for path in ('some.bag', 'day1/one.bag', 'day1/two.bag'):
        with rosbag.Bag(camera_bag) as whole, rosbag.Bag(str(reader.home / path), 'w') as part:
            for topic, message, stamp in whole.read_messages(end_time=time_from(1600000002 * 10 ** 9)):
                part.write(topic, message, stamp)
    reader.types(PROCESS_BAG)
    reader.types(PROCESS_BAGS)
    (reader.home / 'results' / 'two.bag').unlink()
    reader.types(ARRAY_JOB, SLURM_ARRAY_TASK_ID='1')
    reader.types(TRACKS_TO_CSV)
    assert (reader.home / 'tracks.csv').read_text().startswith('stamp_s,id,label,status,x_m,y_m,vx_mps,vy_mps')
    for path in ('result.bag', 'results/one.bag', 'results/two.bag'):
        with rosbag.Bag(str(reader.home / path)) as bag:
            assert bag.get_message_count('/ros_3d_bb/bb_3d') > 1


def test_sessions_and_scenes_become_bags(reader, clone, data):
    assert 'some.bag: 2 images' in reader.types(SAMPLE_BAG, replaced=[('--images 60', '--images 2')])
    at = reader.home / 'bags'
    at.mkdir()
    os.symlink(os.path.join(data, 'data', 'thesis'), str(at / 'SESSION'))
    shutil.copytree(str(clone / 'config' / 'scenarios' / 'rooms'), str(at / 'rooms'))
    shutil.copy(str(clone / 'config' / 'scenarios' / 'thesis_a_start.yaml'), str(at / 'some_scenario.yaml'))
    for block in (SESSION_TO_BAG, SCENARIO_TO_BAG):
        assert 'some.bag: ' in reader.types(block, at)


def test_a_session_is_exported_analysed_and_validated(reader, session_folder):
    folder = reader.home / 'campaign'
    folder.mkdir()
    for name in os.listdir(session_folder):
        os.symlink(os.path.join(session_folder, name), str(folder / name))
    os.symlink(str(folder), str(reader.clone / 'SESSION'))
    assert ', 0 problems' in reader.types(CAMPAIGN, reader.clone)
    assert (reader.clone / 'table.csv').exists() and (folder / 'analysis' / 'report.html').exists()


@pytest.mark.parametrize('block,shortened', BENCHMARKS)
def test_benchmarks_print_a_table(reader, clone, data, block, shortened):
    printed = reader.types(block, clone, appended=shortened, ROS_3D_BB_DATA=data)
    assert len(re.findall(r'\d+\.\d+', printed)) > 5, printed


def test_detectors_are_compared(reader, clone, data):
    outputs = outputs_of('yolox', [(0, 0, 30, 30)], [[1] * 80], (96, 128))
    write_constant_network(reader.home / 'yolox_nano.onnx', outputs)
    printed = reader.types(DETECTORS, clone, appended=' --every 50', ROS_3D_BB_DATA=data)
    assert re.search(r'^ *yolox_nano.onnx  *0 .*^ *depth ', printed, re.DOTALL | re.MULTILINE)


def test_stamp_and_frame_in_the_layout_of_2d_boxes():
    image = Image()
    image.header.stamp, image.header.frame_id = time_from(1600000000000000005), 'some_camera'
    names = {'image': image, 'Int32MultiArray': Int32MultiArray, 'MultiArrayDimension': MultiArrayDimension,
             'x1': 10, 'y1': 20, 'x2': 30, 'y2': 40}
    exec(STAMPED.text, names)  # the README's own code
    boxes = boxes2d_from_msg(names['message'])
    assert (boxes.stamp_ns, boxes.frame_id) == (1600000000000000005, 'some_camera')
    assert boxes.boxes.tolist() == [[10, 20, 30, 40]]


@pytest.mark.parametrize('block', MODEL_SETTINGS, ids=lambda block: block.text.split()[1])
def test_settings_of_models_are_valid(block):
    settings = settings_from(load_yaml(block.text))
    assert settings != ModelSettings() and settings.head in block.text
