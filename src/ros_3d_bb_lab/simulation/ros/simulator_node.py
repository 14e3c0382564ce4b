"""ROS node that simulates a robot with a camera among people."""
import sys
import time
from typing import NamedTuple

import rospy
from rosgraph_msgs.msg import Clock

from ros_3d_bb.conversions.camera_msgs import COLOR_TOPIC, START_NS, TF_TOPIC, TYPES, topic_of
from ros_3d_bb.conversions.perception_msgs import time_from
from ros_3d_bb.core.params import WAIT_FOR_SUBSCRIBERS, Param, parameters
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.msg import TrackedObjectArray
from ros_3d_bb.nodes.common.diagnostics import Diagnostics
from ros_3d_bb.nodes.common.master import is_ending
from ros_3d_bb.nodes.common.startup import read_params, run_node, wait_for_subscribers
from ros_3d_bb_lab.simulation.ros.scenario_to_bag import TRUTH_TOPIC, simulated_messages
from ros_3d_bb_lab.simulation.scenario import read_scenario, with_overrides
from ros_3d_bb_lab.simulation.simulator import Simulator

CLOCK_LEAD_NS = NS  # from the time published while waiting for subscribers to the first image
PAUSE_NS = 3 * NS  # between repetitions of a scene; separates the people of successive repetitions
PROGRESS_S = 1.0  # between log messages


@parameters()
class SimulatorParams(NamedTuple):
    """Parameters of simulator_node, see config/simulator.yaml."""

    scenario: str = Param('')
    rate: float = Param(0.0, 'Rate of the images; 0: that of the scenario.', 'Hz')
    seed: int = Param(
        -1, 'Seed of the noise and of the appearance of people, for the same images in every run; -1: that of the '
        'scenario.', limits=(-1, 2 ** 32 - 1))
    publish_clock: bool = Param(
        False, 'Whether this node publishes the time on /clock (set /use_sim_time too). Then stamps are the same in '
        'every run, and time waits if the machine is too slow. Otherwise, stamps are the time of the machine, and late '
        'images are skipped.')
    speed: float = Param(1.0, 'Speed of the published time; 1: real time.', limits=(0.001, 1000))
    repeat: bool = Param(True, 'Whether the scene starts again 3 s after its end. Otherwise, the node exits.')
    wait_for_subscribers: int = WAIT_FOR_SUBSCRIBERS


class SimulatorNode(object):
    """Play a scenario: colour, aligned depth, camera_info, tf from the map to the camera, and ground truth.

    If the node publishes the time (~publish_clock), time waits for images on slow machines; otherwise late images are
    skipped. If there are several cameras, the name of the camera precedes its topics, for example
    front/color/image_raw. Parameters: config/simulator.yaml.

    Publishes
    ---------
    camera/color/image_raw : sensor_msgs/Image
        Colour image.
    camera/aligned_depth_to_color/image_raw : sensor_msgs/Image
        Depth image, aligned to colour.
    camera/color/camera_info : sensor_msgs/CameraInfo
        Intrinsics of the colour camera.
    camera/aligned_depth_to_color/camera_info : sensor_msgs/CameraInfo
        The same intrinsics, because depth is aligned to colour.
    ground_truth : ros_3d_bb/TrackedObjectArray
        People in the map; their prediction is the true future path.
    /tf : tf2_msgs/TFMessage
        From the map to the camera.
    /clock : rosgraph_msgs/Clock
        Simulated time; only with ~publish_clock.
    """

    def __init__(self):
        self._params, = read_params(SimulatorParams)
        self._simulator = Simulator(_scenario(self._params))
        self._diagnostics = Diagnostics()
        if any(self._simulator.cameras):
            rospy.loginfo('the scenario has several cameras; for the pipeline: cameras:=%s',
                          ','.join(self._simulator.cameras))
        kinds = {topic_of(camera, topic): kind for camera in self._simulator.cameras for topic, kind in TYPES.items()
                 if topic != TF_TOPIC}
        kinds[TRUTH_TOPIC] = TrackedObjectArray
        self._pubs = {topic: rospy.Publisher(topic, kind, queue_size=10) for topic, kind in kinds.items()}
        self._pubs[TF_TOPIC] = rospy.Publisher('/' + TF_TOPIC, TYPES[TF_TOPIC], queue_size=10)
        self._clock_pub = rospy.Publisher('/clock', Clock, queue_size=10) if self._params.publish_clock else None

    def run(self):
        """Play the scene once or repeatedly. If this fails, the exit status is 1."""
        try:
            for camera in self._simulator.cameras:
                # The time is published meanwhile, because rosbag and other nodes subscribe only after it is valid.
                wait_for_subscribers(self._pubs[topic_of(camera, COLOR_TOPIC)], self._params.wait_for_subscribers,
                                     lambda: self._publish_clock(START_NS))
            start_ns = START_NS + CLOCK_LEAD_NS if self._clock_pub is not None else rospy.get_rostime().to_nsec()
            while not rospy.is_shutdown():
                self._play(start_ns)
                if not self._params.repeat:
                    rospy.loginfo('the scene is over')
                    break
                if self._clock_pub is not None:
                    start_ns += int(self._simulator.scenario.duration * NS) + PAUSE_NS
                else:
                    time.sleep(PAUSE_NS / NS)
                    start_ns = rospy.get_rostime().to_nsec()
        except Exception as error:
            if not is_ending():
                rospy.logfatal('the simulation ends: %s: %s', type(error).__name__, error)
                sys.exit(1)

    def _play(self, start_ns):
        """Play the scene once, with the first image at `start_ns`."""
        began_s, number = time.monotonic(), 0
        while number < self._simulator.frame_count and not rospy.is_shutdown():
            due_s = began_s + self._simulator.time_s(number) / self._params.speed
            time.sleep(max(0.0, due_s - time.monotonic()))
            self._publish(number, start_ns)
            number += 1
            rospy.loginfo_throttle(PROGRESS_S, 'image %d of %d' % (number, self._simulator.frame_count))
            if self._clock_pub is None:
                missed = int((time.monotonic() - began_s) * self._simulator.rate) - number
                if missed > 0:
                    self._diagnostics.count('images skipped', missed)
                    number += missed
            else:
                began_s = max(began_s, time.monotonic() - self._simulator.time_s(number) / self._params.speed)

    def _publish(self, number, start_ns):
        frame = self._simulator.frame(number)
        stamp_ns = start_ns + int(round(frame.time_s * NS))
        messages = simulated_messages(self._simulator, frame, stamp_ns)
        self._publish_clock(stamp_ns)
        for topic, message in messages:
            self._pubs[topic].publish(message)
        self._diagnostics.count('images')
        self._diagnostics.record_latency(time_from(stamp_ns))

    def _publish_clock(self, stamp_ns):
        if self._clock_pub is not None:
            self._clock_pub.publish(Clock(time_from(stamp_ns)))


def _scenario(params):
    if not params.scenario:
        raise ValueError('no scenario given; set ~scenario (launch argument scenario:=) to the path of a file such as '
                         'those in config/scenarios')
    if params.speed != 1 and not params.publish_clock:
        raise ValueError('parameter ~speed is %g; without ~publish_clock, 1 expected' % params.speed)
    try:
        scenario = read_scenario(params.scenario)
    except OSError as error:
        raise ValueError('the scenario cannot be read: %s; an absolute path expected' % error)
    return with_overrides(scenario, params.rate or None, None if params.seed < 0 else params.seed)


def main():
    """Run the node."""
    run_node('simulator_node', SimulatorNode, SimulatorNode.run)
