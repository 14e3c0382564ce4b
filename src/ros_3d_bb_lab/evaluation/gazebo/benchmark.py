"""Scenes in Gazebo, with the camera of a standing Jackal."""
import os
import subprocess
import tempfile

import numpy as np
import rosbag
from tf2_msgs.msg import TFMessage

from ros_3d_bb.bags.bag_reader import BagReader, message_in
from ros_3d_bb.bags.bag_tf_buffer import BagTransforms
from ros_3d_bb.conversions.camera_msgs import COLOR_TOPIC, DEPTH_TOPIC, INFO_TOPICS, STATIC_TOPIC, TF_TOPIC
from ros_3d_bb.conversions.perception_msgs import NEWEST, TRACKS_TOPIC, stamp_of, tracks_from_msg
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.tracking.types import VISIBLE, CameraView
from ros_3d_bb_lab.evaluation.clear_mot import Moment, score
from ros_3d_bb_lab.evaluation.defaults import add_scenarios, describe_machine, scene_name
from ros_3d_bb_lab.evaluation.gazebo.people_truth import PREDICTION_S, PeopleTruth
from ros_3d_bb_lab.evaluation.launching import free_port, running_roslaunch
from ros_3d_bb_lab.evaluation.scene_benchmark import score_tracks
from ros_3d_bb_lab.evaluation.text_table import line_of
from ros_3d_bb_lab.simulation.gazebo_world import world_of
from ros_3d_bb_lab.simulation.scenario import read_scenario

WORLD_FRAME = 'odom'  # of a robot that starts at the origin of the world and stands
STATES_TOPIC = 'gazebo/model_states'
RECORDED = COLOR_TOPIC, DEPTH_TOPIC, INFO_TOPICS[0], TF_TOPIC, STATIC_TOPIC, STATES_TOPIC
START_S = 4.0  # simulated time at which people begin to move
SETTLING_S = 0.5  # Gazebo places people at the origin for a moment when they start
TIMEOUT_S = 600.0


def record_scene(scenario, folder):
    """Run a scenario in Gazebo. Returns the path of the bag with images, tf and model states.

    Raises RuntimeError with the end of the log if nothing was recorded.
    """
    world, bag, log_path = (os.path.join(folder, name) for name in ('scene.world', 'scene.bag', 'launch.log'))
    with open(world, 'w') as stream:
        stream.write(world_of(scenario, START_S))
    arguments = {'world': world, 'gui': 'false', 'rviz': 'false', 'paused': 'true', 'lockstep': 'true',
                 'detector': 'none'}
    port = free_port()
    environment = dict(os.environ, ROS_MASTER_URI='http://localhost:%d' % port)
    os.environ['GAZEBO_MASTER_URI'] = 'http://localhost:%d' % free_port()  # the last Gazebo may still be ending
    with open(log_path, 'w') as log, running_roslaunch(
            ['ros_3d_bb', 'gazebo.launch'] + ['%s:=%s' % item for item in arguments.items()], port, log):
        _wait_for_robot(environment)
        duration_s = START_S + scenario.duration + PREDICTION_S
        recording = subprocess.Popen(['rosbag', 'record', '--lz4', '-b', '0', '--duration=%g' % duration_s, '-O', bag]
                                     + ['/' + name for name in RECORDED], env=environment, stdout=log, stderr=log)
        subprocess.check_call(['rosservice', 'call', 'gazebo/unpause_physics'], env=environment, stdout=log)
        recording.wait(TIMEOUT_S)
    if not os.path.exists(bag):
        with open(log_path) as stream:
            raise RuntimeError('nothing was recorded; the end of the log:\n' + stream.read()[-3000:])
    return bag


def _wait_for_robot(environment):
    command = ['bash', '-c', 'until rostopic list -p 2> /dev/null | grep -q %s; do sleep 1; done' % DEPTH_TOPIC]
    subprocess.check_call(command, env=environment, timeout=TIMEOUT_S)


def moments_in(scene_bag, tracks_bag, start_ns):
    """Moment (`clear_mot`) of each image from `start_ns` on. Only visible people are truth."""
    transforms = BagTransforms()
    with BagReader(scene_bag) as reader:
        for raw in reader.messages(['/' + TF_TOPIC]):
            transforms.add(message_in(raw, TFMessage))
        for raw in reader.messages(['/' + STATIC_TOPIC]):
            transforms.add_static(message_in(raw, TFMessage))
    with rosbag.Bag(scene_bag) as bag:
        truth = PeopleTruth((time.to_sec(), message)
                            for _topic, message, time in bag.read_messages(['/' + STATES_TOPIC]))
        images = [message.header for _topic, message, _time in bag.read_messages(['/' + INFO_TOPICS[0]])]
    with rosbag.Bag(tracks_bag) as bag:
        tracks = {stamp_of(message): tracks_from_msg(message)
                  for _topic, message, _time in bag.read_messages(['/' + TRACKS_TOPIC])}
    moments = []
    view = CameraView(transforms.lookup(WORLD_FRAME, images[0].frame_id, NEWEST))  # the robot stands
    for header in images:
        stamp_ns = header.stamp.to_nsec()
        if start_ns <= stamp_ns:
            people = [person for person in truth.tracks_at(stamp_ns, view) if person.status == VISIBLE]
            moments.append(Moment(stamp_ns, people, tracks.get(stamp_ns, [])))
    return moments


def result_of(moments):
    """Scores of a tracker in a scene as a dictionary: lengths in metres, the rate in Hz, `detected` a share 0..1."""
    tracked = score(moments)
    errors_m = [(person.rmse_m, person.detected * person.visible_s) for person in tracked.people if person.ids]
    seconds = (moments[-1].stamp_ns - moments[0].stamp_ns) / NS
    result = {'images': len(moments), 'rate_hz': (len(moments) - 1) / seconds,
              'detected': float(np.average([person.detected for person in tracked.people],
                                           weights=[person.visible_s for person in tracked.people])),
              'id_switches': sum(person.switches for person in tracked.people),
              'false_share': tracked.false_share,
              'rmse_m': float(np.sqrt(np.average([rmse_m ** 2 for rmse_m, _weight in errors_m],
                                                 weights=[weight for _rmse_m, weight in errors_m])))}
    result.update(score_tracks([(moment.truth, moment.tracks) for moment in moments], (1.0, PREDICTION_S)))
    return result


def run(arguments):
    detector = (['--detector', 'yolov5', '--weights', os.path.abspath(arguments.weights)] if arguments.weights
                else ['--detector', 'depth'])
    print(describe_machine(), flush=True)
    results = [_run(path, detector) for path in arguments.scenarios]
    return {'machine': describe_machine(), 'detector': detector[1], 'scenes': results}


def add_options(parser):
    add_scenarios(parser, 'thesis_*')
    parser.add_argument('--weights', metavar='FILE', help='network of the detector yolov5; without it, depth')


def _run(path, detector):
    with tempfile.TemporaryDirectory() as folder:
        recorded, target = record_scene(read_scenario(path), folder), os.path.join(folder, 'tracks.bag')
        subprocess.check_call(['rosrun', 'ros_3d_bb', 'process_bag', recorded, target, '--target-frame', WORLD_FRAME,
                               '--keep'] + detector, stdout=subprocess.DEVNULL)
        result = dict(result_of(moments_in(recorded, target, int((START_S + SETTLING_S) * NS))), scene=scene_name(path))
    print(line_of(**result), flush=True)
    return result
