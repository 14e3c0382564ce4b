"""A simulated camera whose images, time and transforms a test can stop, and checks of the resulting tracks.

The clock of the stage advances with each image, so that the speed of the machine does not matter: durations in seconds
of the stage are numbers of images.
"""
import time

import numpy as np
import rospy
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import PointCloud2

from ros_3d_bb.conversions.camera_msgs import COLOR_TOPIC, DEPTH_TOPIC, INFO_TOPICS, START_NS, TF_TOPIC, TYPES
from ros_3d_bb.conversions.perception_msgs import time_from, with_stamp
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.msg import TrackedObject, TrackedObjectArray
from ros_3d_bb_lab.simulation.ros.scenario_to_bag import simulated_messages
from ros_3d_bb_lab.simulation.scenario import scenario_from
from ros_3d_bb_lab.simulation.simulator import Simulator
from support.ros import TIMEOUT_S, Recorder, happens, publisher

TOPICS = INFO_TOPICS[0], DEPTH_TOPIC, COLOR_TOPIC, TF_TOPIC
PERIOD_NS = NS // 10
RECOVERY_IMAGES = 20  # 2 s
IMPATIENCE_S = 1.0  # timeout of an image that a starting node may miss
STAYING = {'start': [5.0, -0.9], 'facing': 1.6, 'height': 1.7}
SCENES = ([STAYING, {'start': [4.0, 0.8], 'facing': 3.1, 'height': 1.8}],
          [STAYING, {'start': [3.0, -1.2], 'facing': 3.1, 'height': 1.8}])  # the second person is replaced
NEAR_M = 0.5  # people are 1.7 m apart and more
SHOWN_S = 0.5  # how long undetected people in view are published (0.4 s, and an image)


class Stage(object):
    """Camera, tf and clock; collects the tracks.

    `scene` is the index of the current one of SCENES, `now_ns` the stamp of the newest image, and `rows` are lines of
    text with the measured recovery times.
    """

    def __init__(self):
        self._clock_pub = rospy.Publisher('/clock', Clock, queue_size=10)
        self.scene, self.now_ns, self._round, self.rows = 0, START_NS, 0, []
        self._scenes = [_scene(number) for number in range(len(SCENES))]
        self._sent = {}  # stamp: (number of previous jumps back, {name: position of a person})
        self._checked, self._newest, self._names = 0, (0, 0), {}
        self._pubs = {topic: publisher('/tf' if topic == TF_TOPIC else topic, TYPES[topic]) for topic in TOPICS}
        self.tracks = Recorder('ros_3d_bb/tracks', TrackedObjectArray)
        self.points = Recorder('planner_bridge_node/points', PointCloud2)

    def send(self, without=()):
        """Send the next image, except for some topics; returns its stamp."""
        self.pass_time(PERIOD_NS)
        messages, people = self._scenes[self.scene]
        self._sent[self.now_ns] = self._round, people
        for topic, message in messages:
            if topic not in without:
                self._pubs[topic].publish(with_stamp(message, time_from(self.now_ns)))
        return self.now_ns

    def pass_time(self, elapsed_ns):
        """Move the clock, backwards if negative."""
        self.now_ns += elapsed_ns
        self._round += elapsed_ns < 0
        self.publish_time(self.now_ns)

    def publish_time(self, time_ns):
        self._clock_pub.publish(Clock(time_from(time_ns)))

    def pause(self, seconds, speed=10.0):
        """Let time pass without images, faster than real time."""
        for _tick in range(int(10 * seconds)):
            self.pass_time(NS // 10)
            time.sleep(0.1 / speed)

    def step(self):
        assert self.tries(TIMEOUT_S), 'no tracks of the image of %.3f' % (self.now_ns / NS)

    def tries(self, timeout_s):
        """Send the next image, which a node may miss. Returns whether its tracks arrive."""
        stamp = time_from(self.send())
        return happens(lambda: self.tracks.messages and self.tracks.messages[-1].header.stamp == stamp, timeout_s)

    def recovered(self, fault, limit=RECOVERY_IMAGES):
        """Send images until all people are tracked and sent to planners, and measure how many it takes.

        The first images may be missed; after the first answer, each image is waited for. Returns {name: track ID}.
        """
        began_s, sent = time.monotonic(), set()
        for count in range(1, limit + 1):
            is_answered = self.tries(_timeout_s(self.tracks.messages, sent))
            sent.add(self.now_ns)
            if is_answered and self._is_complete(sent):
                self.rows.append('%-66s %2d images (%.1f s of the stage), %.1f s of real time' % (
                    fault, count, count * PERIOD_NS / NS, time.monotonic() - began_s))
                self.check()
                return self.ids()
        raise AssertionError('%s: not recovered after %d images; the last tracks: %s' % (
            fault, limit, self.tracks.messages[-1:]))

    def ids(self):
        message = self.tracks.messages[-1]
        _round, people = self._sent[message.header.stamp.to_nsec()]
        return {_name_of(track, people): track.id for track in message.objects}

    def _is_complete(self, sent):
        _round, people = self._sent[self.now_ns]
        tracks, stamp = self.tracks.messages[-1].objects, time_from(self.now_ns)
        return (all(track.status == TrackedObject.VISIBLE for track in tracks)
                and sorted(_name_of(track, people) or '' for track in tracks) == sorted(people)
                and happens(lambda: any(message.header.stamp == stamp and message.width
                                        for message in self.points.messages[-5:]),
                            _timeout_s(self.points.messages, sent)))

    def check(self):
        """Check new tracks: stamps are those of images, in order; each track is a person, and keeps to that person."""
        messages = self.tracks.messages[self._checked:]
        self._checked += len(messages)
        for message in messages:
            stamp_ns = message.header.stamp.to_nsec()
            assert stamp_ns in self._sent, 'tracks at %.3f, without an image' % (stamp_ns / NS)
            now = self._sent[stamp_ns][0], stamp_ns
            assert now >= self._newest, 'tracks at %.3f after %.3f' % (stamp_ns / NS, self._newest[1] / NS)
            self._newest, people = now, self._recent_people(stamp_ns)
            for track in message.objects:
                name = _name_of(track, people)
                assert name, 'a false track at %.3f: %s' % (stamp_ns / NS, track)
                assert self._names.setdefault(track.id, name) == name, 'track %d was %s and is %s' % (
                    track.id, self._names[track.id], name)

    def _recent_people(self, stamp_ns):
        people = {}
        for other_ns in range(stamp_ns, stamp_ns - int(SHOWN_S * NS), -PERIOD_NS):
            other_round, others = self._sent.get(other_ns, (None, {}))
            if other_round == self._sent[stamp_ns][0]:
                people.update(others)
        return people


def _timeout_s(messages, sent):
    """How long to wait for the next answer: shortly as long as the images that were sent may have been missed."""
    return TIMEOUT_S if any(message.header.stamp.to_nsec() in sent for message in messages[-5:]) else IMPATIENCE_S


def _scene(number):
    """The messages of an image without their stamps, and {name: position} of the people."""
    simulator = Simulator(scenario_from({'rate': 10.0, 'people': SCENES[number]}))
    frame = simulator.frame(0)
    messages = [entry for entry in simulated_messages(simulator, frame, START_NS) if entry[0] in TOPICS]
    names = 'the person in both scenes', 'the person in scene %d' % number
    return messages, {name: person.position_m for name, person in zip(names, frame.people)}


def _name_of(track, people):
    position = track.pose.pose.position
    near = [name for name, position_m in people.items()
            if np.hypot(position.x - position_m[0], position.y - position_m[1]) < NEAR_M]
    return near[0] if near else None
