"""The camera, the transforms of the robot, and the clock: images of scenes, which faults change."""
import collections
import itertools
import threading
import time

import rospy
from rosgraph_msgs.msg import Clock
from std_msgs.msg import Int32MultiArray

from ros_3d_bb.conversions.camera_msgs import START_NS, TF_TOPIC, TYPES
from ros_3d_bb.conversions.perception_msgs import BOXES3D_TOPIC, BOXES_TOPIC, TRACKS_TOPIC, time_from, with_stamp
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.msg import BoundingBox3DArray, TrackedObjectArray
from ros_3d_bb_lab.simulation.ros.scenario_to_bag import scenario_images

ROUNDS = 3  # repetitions of a scene, forwards and backwards, before the next one
AFTER_JUMP_NS = 1009  # added at each jump, so that no stamp is repeated
OTHERS = {BOXES_TOPIC: Int32MultiArray, BOXES3D_TOPIC: BoundingBox3DArray, TRACKS_TOPIC: TrackedObjectArray}


def rendered(scenario, images, with_boxes):
    """The first images of a scenario, [[(topic, message), ...], ...]."""
    wanted = set(TYPES) | ({BOXES_TOPIC} if with_boxes else set())
    return [[(topic, message) for topic, message in messages if topic in wanted]
            for _stamp_ns, messages in itertools.islice(scenario_images(scenario, with_boxes), images)]


class Camera(object):
    """Sends images at a rate, and publishes a clock, until it is stopped.

    `images`, `wrong_ns` and `sent` are those of `records.Record`. Faults change `sends` (images), `publishes_clock`,
    `missing` (topics that are left out), `change` (a function of topic and message, which returns another message) and
    `throw_in` (a function of the stamp and the messages of an image, which returns messages to be sent with it).
    """

    def __init__(self, scenes, rate_hz):
        self.sends, self.publishes_clock, self.missing = True, True, set()
        self.change, self.throw_in = lambda _topic, message: message, lambda _stamp_ns, _good: []
        self.images, self.wrong_ns, self.sent = [], set(), collections.Counter()
        self._scenes, self._period_ns = scenes, int(NS / rate_hz)
        self._now_ns, self._jump_ns, self._runs = START_NS + 1000 * NS, 0, True
        self._pubs = {topic: rospy.Publisher('/tf' if topic == TF_TOPIC else topic, kind, queue_size=10)
                      for topic, kind in dict(TYPES, **OTHERS).items()}
        self._clock_pub = rospy.Publisher('/clock', Clock, queue_size=10)
        self._thread = threading.Thread(target=self._run)
        self._thread.daemon = True
        self._thread.start()

    def jump(self, seconds):
        """Shift all later stamps."""
        self._jump_ns += int(seconds * NS) + AFTER_JUMP_NS

    def stop(self):
        """Stop after the current image."""
        self._runs = False
        self._thread.join()

    def _run(self):
        played = itertools.chain.from_iterable((scene + scene[-2:0:-1]) * ROUNDS for scene in itertools.cycle(
            self._scenes))
        due_s = time.monotonic()
        while self._runs:
            due_s = max(due_s + self._period_ns / NS, time.monotonic() - self._period_ns / NS)
            time.sleep(max(0.0, due_s - time.monotonic()))
            jump_ns, self._jump_ns = self._jump_ns, 0
            if self.publishes_clock or jump_ns:
                self._now_ns += self._period_ns + jump_ns
                self._clock_pub.publish(Clock(time_from(self._now_ns)))
            if self.sends and self.publishes_clock:
                self._send(next(played))

    def _send(self, messages):
        stamp = time_from(self._now_ns)
        wrong = self.throw_in(self._now_ns, dict(messages))
        self.images.append((self._now_ns, time.monotonic()))
        for topic, message in messages:
            if topic not in self.missing:
                self._publish(topic, self.change(topic, with_stamp(message, stamp)))
        for topic, stamp_ns, message in wrong:
            self.wrong_ns.add(stamp_ns)
            self._publish(topic, message)

    def _publish(self, topic, message):
        self.sent[topic] += self._pubs[topic].get_num_connections() > 0
        self._pubs[topic].publish(message)
