"""The measurement campaign of the README and doc/campaign.md: measure, annotate, analyse, use the error model."""
import json
import os
import re
import subprocess

import pytest

from ros_3d_bb.sessions.session_reader import read_session
from support.code_blocks import claimed

BOXES, TRACKS = 'ros_3d_bb/bb_3d:boxes', 'ros_3d_bb/tracks:objects'
MEASURE = claimed('roslaunch ros_3d_bb measure.launch')
CAPTURE, CAPTURED = claimed('rosservice call /viewer_node/capture'), claimed('success: True', 'text')
ANNOTATE = claimed('rosrun ros_3d_bb annotator $HOME/campaign')
SCRIPTS = claimed('annotator/annotator --export')
CORRECTED = claimed('roslaunch ros_3d_bb pipeline.launch weights:=$HOME/yolov5n.pt error_model:=')
WITHOUT_RVIZ = claimed('roslaunch ros_3d_bb simulation.launch rviz:=false')
VIEWER = claimed('roslaunch ros_3d_bb viewer.launch')


@pytest.fixture(scope='module')
def campaign(reader, session_folder):
    """An annotated session in the home folder, with links to the images."""
    folder = reader.home / 'campaign'
    for name in ('color', 'depth'):
        (folder / name).mkdir(parents=True)
        for image in os.listdir(os.path.join(session_folder, name)):
            os.symlink(os.path.join(session_folder, name, image), str(folder / name / image))
    with open(os.path.join(session_folder, 'frames.json')) as stream:
        (folder / 'frames.json').write_text(stream.read())
    return folder


def test_measurements_are_taken_into_the_session(reader, camera_bag, campaign):
    before = len(read_session(str(campaign)).frames)
    with reader.running(MEASURE, READER_BAG=camera_bag, DISPLAY=reader.screen()) as graph:
        graph.shows('ros_3d_bb viewer')
        graph.hears(BOXES)
        answer = reader.types(CAPTURE, ROS_MASTER_URI=graph.environment['ROS_MASTER_URI'])
    assert len(read_session(str(campaign)).frames) == before + 1
    assert without_figures(answer) == without_figures(CAPTURED.text.replace('/home/you', str(reader.home)))


def without_figures(text):
    return re.sub(r'\d+', '0', re.sub(r'saved \S+', 'saved ID', text)).strip()


def test_the_annotator_opens_the_campaign(reader, campaign):
    with reader.running(ANNOTATE, DISPLAY=reader.screen()) as program:
        program.shows('campaign')


def test_scripts_export_analyse_and_validate_it(reader, campaign):
    os.symlink(str(campaign), str(reader.clone / 'SESSION'))
    assert ', 0 problems' in reader.types(SCRIPTS, reader.clone)
    assert (reader.clone / 'table.csv').exists() and (campaign / 'analysis' / 'report.html').exists()


def test_its_error_model_gives_positions_a_covariance(reader, camera_bag, campaign):
    assert (campaign / 'analysis' / 'error_model.yaml').exists()  # written by the analysis
    with reader.running(CORRECTED) as graph:
        graph.starts_camera(camera_bag)
        graph.hears(TRACKS)
        text = subprocess.check_output(['rostopic', 'echo', '-n', '1', '/ros_3d_bb/bb_3d/boxes[0]/position_covariance'],
                                       env=graph.environment, universal_newlines=True)
    assert max(json.loads(text.split('---')[0].replace('(', '[').replace(')', ']'))) > 0


def test_the_viewer_joins_a_simulation(reader):
    with reader.running(WITHOUT_RVIZ) as simulation:
        simulation.hears(BOXES)
        with reader.running(VIEWER, ROS_MASTER_URI=simulation.environment['ROS_MASTER_URI'],
                            DISPLAY=reader.screen()) as viewer:
            viewer.shows('ros_3d_bb viewer')
