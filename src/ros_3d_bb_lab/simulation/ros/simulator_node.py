"""ROS node that simulates a robot with a camera among people."""
import itertools
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple

import rospy
from rosgraph_msgs.msg import Clock
from std_msgs.msg import Int32MultiArray, Time

from ros_3d_bb.conversions.camera_msgs import COLOR_TOPIC, START_NS, TF_TOPIC, TYPES, topic_of
from ros_3d_bb.conversions.perception_msgs import BOXES_TOPIC, time_from
from ros_3d_bb.core.object_classes import PERSON
from ros_3d_bb.core.params import WAIT_FOR_SUBSCRIBERS, Param, parameters
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.msg import TrackedObjectArray
from ros_3d_bb.nodes.common.diagnostics import Diagnostics
from ros_3d_bb.nodes.common.master import is_ending
from ros_3d_bb.nodes.common.startup import SENDING_S, read_params, wait_for_subscribers
from ros_3d_bb_lab.simulation.ros.driven_robot import QUEUE_SIZE, DrivenRobot, robot_transforms
from ros_3d_bb_lab.simulation.ros.scenario_to_bag import TRUTH_TOPIC, boxes_message, simulated_messages
from ros_3d_bb_lab.simulation.scenario import read_scenario, with_overrides
from ros_3d_bb_lab.simulation.simulator import STEP_S, Simulator, jittered_boxes

CLOCK_LEAD_NS = NS  # from the time published while waiting for subscribers to the first image
PAUSE_NS = 3 * NS  # between repetitions of a scene; separates the people of successive repetitions
PROGRESS_S = 1.0  # between log messages
CATCH_UP_S = 0.1  # by so much the published time may hurry after a delay; then it waits
JOIN_S = 0.1
LIMIT_POLL_S = 0.001


@parameters()
class SimulatorParams(NamedTuple):
    """Parameters of simulator_node, see config/simulator.yaml."""

    scenario: str = Param('')
    rate: float = Param(0.0, 'Rate of the images; 0: that of the scenario.', 'Hz')
    seed: int = Param(
        -1, 'Seed of the noise and of the appearance of people, for the same images in every run; -1: that of the '
        'scenario.', limits=(-1, 2 ** 32 - 1))
    drive: bool = Param(False)
    boxes: bool = Param(
        False, 'Whether to publish the true 2D boxes of people in place of a detector, with a jitter of 1 pixel.')
    supervised: bool = Param(
        False, 'Whether another node controls the time: the scene stands still until the first message on ~time_limit, '
        'and its time never exceeds the last one.')
    repeat: bool = Param(True, 'Whether the scene starts again 3 s after its end. Otherwise, the node exits.')
    wait_for_subscribers: int = WAIT_FOR_SUBSCRIBERS


class SimulatorNode(object):
    """Play a scenario: colour, aligned depth, camera_info, tf from the map to the camera, and ground truth.

    The node publishes the time (set /use_sim_time), which waits for images on slow machines: stamps are the same in
    every run. Time and tf do not depend on the rate of the images: they are published 50 times per second, and with the
    stamp of each image. If there are several cameras, the name of the camera precedes its topics, for example
    front/color/image_raw.

    With ~drive the robot obeys cmd_vel instead of its moves, within the limits of robot.drive in the scenario, and
    stops if it receives no command for 0.5 s. It stops at people, furniture and walls. Parameters:
    config/simulator.yaml.

    Subscribes
    ----------
    cmd_vel : geometry_msgs/Twist
        Linear velocity x and angular velocity z of the robot; only with ~drive.
    ~time_limit : std_msgs/Time
        Time at which the published time waits; only with ~supervised.

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
    yolo_bounding_box : std_msgs/Int32MultiArray
        True 2D boxes, jittered; only with ~boxes.
    ground_truth : ros_3d_bb/TrackedObjectArray
        People in the map; their prediction is the true future path.
    /tf : tf2_msgs/TFMessage
        From the map to the camera.
    /clock : rosgraph_msgs/Clock
        Simulated time.
    odom : nav_msgs/Odometry
        Measured motion, with the errors of robot.drive.odometry_error; only with ~drive.
    collisions : std_msgs/UInt32
        Number of collisions of the robot since the start of the scene, latched; only with ~drive.
    clearance : std_msgs/Float32
        Distance between the robot and the nearest person, negative during a contact; only with ~drive.
    """

    def __init__(self):
        self._params, = read_params(SimulatorParams)
        self._simulator = Simulator(_scenario(self._params))
        self._diagnostics = Diagnostics()
        if any(self._simulator.camera_names):
            rospy.loginfo('the scenario has several cameras; for the pipeline: cameras:=%s',
                          ','.join(self._simulator.camera_names))
        kinds = {topic_of(name, topic): kind for name in self._simulator.camera_names for topic, kind in TYPES.items()
                 if topic != TF_TOPIC}
        kinds[TRUTH_TOPIC] = TrackedObjectArray
        if self._params.boxes:
            kinds.update((topic_of(name, BOXES_TOPIC), Int32MultiArray) for name in self._simulator.camera_names)
        self._pubs = {topic: rospy.Publisher(topic, kind, queue_size=10) for topic, kind in kinds.items()}
        self._tf_pub = rospy.Publisher('/' + TF_TOPIC, TYPES[TF_TOPIC], queue_size=QUEUE_SIZE)
        self._clock_pub = rospy.Publisher('/clock', Clock, queue_size=QUEUE_SIZE)
        self._renderer, self._rendering, self._failed = ThreadPoolExecutor(max_workers=1), None, False
        self._robot = DrivenRobot(self._simulator, self._diagnostics) if self._params.drive else None
        self._limit_ns = None
        if self._params.supervised:
            rospy.Subscriber('~time_limit', Time, self._on_time_limit, queue_size=1)

    def run(self):
        """Play the scene once or repeatedly. If this fails, the exit status is 1."""
        player = threading.Thread(target=self._run, daemon=True)  # publishing in the main thread can block on SIGINT
        player.start()
        while player.is_alive() and not rospy.is_shutdown():
            player.join(JOIN_S)
        if self._failed:
            sys.exit(1)

    def _run(self):
        try:
            self._play_rounds()
        except Exception as error:
            if not is_ending():
                rospy.logfatal('the simulation ends: %s: %s', type(error).__name__, error)
                self._failed = True

    def _play_rounds(self):
        for name in self._simulator.camera_names:
            # The time is published meanwhile, because rosbag and other nodes subscribe only after it is valid.
            wait_for_subscribers(self._pubs[topic_of(name, COLOR_TOPIC)], self._params.wait_for_subscribers,
                                 lambda: self._publish_clock(START_NS))
        start_ns = START_NS + CLOCK_LEAD_NS
        if self._params.supervised:
            start_ns = self._stand_still(start_ns)
        while not rospy.is_shutdown():
            self._play(start_ns)
            if not self._params.repeat:
                rospy.loginfo('the scene is over')
                time.sleep(SENDING_S)
                break
            start_ns += int(self._simulator.scenario.duration * NS) + PAUSE_NS

    def _stand_still(self, start_ns):
        """Publish the start of the scene until the first time limit. Returns the time of the limit."""
        state, period_ns = self._simulator.state_at(0.0), int(NS / self._simulator.rate)
        number = itertools.cycle(range(len(self._simulator.camera_names)))
        for stamp_ns in itertools.count(start_ns, int(STEP_S * NS)):
            if self._limit_ns is not None or rospy.is_shutdown():
                self._wait_for_image()
                return stamp_ns
            self._publish_state(state, stamp_ns)
            if stamp_ns // period_ns > (stamp_ns - int(STEP_S * NS)) // period_ns:
                self._render(next(number), state, stamp_ns)
            time.sleep(STEP_S)

    def _play(self, start_ns):
        world = self._robot.restarted() if self._robot is not None else self._simulator
        began_s = time.monotonic()
        for time_s, number in self._simulator.steps():
            if rospy.is_shutdown():
                return
            time.sleep(max(0.0, began_s + time_s - time.monotonic()))
            stamp_ns = start_ns + int(round(time_s * NS))
            while self._limit_ns is not None and stamp_ns > self._limit_ns and not rospy.is_shutdown():
                time.sleep(LIMIT_POLL_S)
            state = world.state_at(time_s)
            self._publish_state(state, stamp_ns)
            if number is not None:
                self._render(number, state, stamp_ns)
            began_s = max(began_s, time.monotonic() - time_s - CATCH_UP_S)
        self._wait_for_image()

    def _publish_state(self, state, stamp_ns):
        self._publish_clock(stamp_ns)
        self._tf_pub.publish(robot_transforms(self._simulator, state, time_from(stamp_ns)))
        if self._robot is not None:
            self._robot.publish(state, time_from(stamp_ns))

    def _on_time_limit(self, message):
        self._limit_ns = message.data.to_nsec()

    def _render(self, number, state, stamp_ns):
        self._wait_for_image()
        self._rendering = self._renderer.submit(self._publish_image, number, state, stamp_ns)

    def _wait_for_image(self):
        if self._rendering is not None:
            self._rendering.result()

    def _publish_image(self, number, state, stamp_ns):
        frame = self._simulator.frame(number, state)
        messages = [entry for entry in simulated_messages(self._simulator, frame, stamp_ns) if entry[0] != TF_TOPIC]
        if self._params.boxes:
            boxes = jittered_boxes(frame, self._simulator.camera, self._simulator.scenario.seed)
            messages.append(boxes_message(frame, boxes.astype(int), stamp_ns, [PERSON] * len(boxes)))
        for topic, message in messages:
            self._pubs[topic].publish(message)
        rospy.loginfo_throttle(PROGRESS_S, 'image %d of %d' % (number + 1, self._simulator.frame_count))
        self._diagnostics.count('images')
        self._diagnostics.record_latency(time_from(stamp_ns))

    def _publish_clock(self, stamp_ns):
        self._clock_pub.publish(Clock(time_from(stamp_ns)))


def _scenario(params):
    if not params.scenario:
        raise ValueError('no scenario given; set ~scenario to the path of a file such as those in config/scenarios')
    try:
        scenario = read_scenario(params.scenario)
    except OSError as error:
        raise ValueError('the scenario cannot be read: %s; an absolute path expected' % error)
    return with_overrides(scenario, params.rate or None, None if params.seed < 0 else params.seed)
