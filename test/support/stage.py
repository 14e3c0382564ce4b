"""A simulated camera whose images, time and transforms a test stops, and a witness of what the pipeline makes of them.

The clock of the stage moves with each image, so how fast the machine is does not matter: what is told in seconds of
the stage is told in images.
"""
import time
from typing import Any, NamedTuple

import numpy as np
import rospy
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import PointCloud2

from ros_3d_bb.conversions.camera_msgs import COLOR_TOPIC, DEPTH_TOPIC, INFO_TOPICS, START_NS, TF_TOPIC, TYPES
from ros_3d_bb.conversions.perception_msgs import time_from, with_stamp
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.msg import TrackedObject, TrackedObjectArray
from ros_3d_bb_lab.simulation.ros.simulator_msgs import simulated_messages
from ros_3d_bb_lab.simulation.scenario import scenario_from
from ros_3d_bb_lab.simulation.simulator import Simulator
from support.ros import TIMEOUT_S, Recorder, publisher, wait_until

TOPICS = INFO_TOPICS[0], DEPTH_TOPIC, COLOR_TOPIC, TF_TOPIC
PERIOD_NS = NS // 10
RECOVERY_IMAGES = 20  # 2 s
IMPATIENCE_S = 1.0  # for the answer to an image that a node may miss as it starts
STAYING = {'start': [5.0, -0.9], 'facing': 1.6, 'height': 1.7}
SCENES = ([STAYING, {'start': [4.0, 0.8], 'facing': 3.1, 'height': 1.8}],
          [STAYING, {'start': [3.0, -1.2], 'facing': 3.1, 'height': 1.8}])  # the second has left, a third has come
NEAR_M = 0.5  # people are 1.7 m apart and more
SHOWN_S = 0.5  # for how long people are published who should be seen and are not (~max_missed_time, and an image)


class Moment(NamedTuple):
    """When an image was sent: how often time had gone back before, and who was there, {name: position in the map}."""

    round: int
    people: Any


class Stage(object):
    """Camera, tf and clock; collects the tracks.

    Attributes
    ----------
    scene : int
        Which of SCENES the camera sees.
    now_ns : int
        Stamp of the newest image.
    rows : list
        What was measured, lines of text.
    """

    def __init__(self):
        self._clock_pub = rospy.Publisher('/clock', Clock, queue_size=10)
        self.scene, self.now_ns, self._round, self.rows = 0, START_NS, 0, []
        self._scenes = [_scene(number) for number in range(len(SCENES))]
        self._moments = {}  # by stamp
        self._checked, self._newest, self._names = 0, (0, 0), {}
        self._pubs = {topic: publisher('/tf' if topic == TF_TOPIC else topic, TYPES[topic]) for topic in TOPICS}
        self.tracks = Recorder('ros_3d_bb/tracks', TrackedObjectArray)
        self.points = Recorder('planner_bridge_node/points', PointCloud2)

    def send(self, without=()):
        """Send the next image, but for some topics; returns its stamp."""
        self.pass_time(PERIOD_NS)
        messages, people = self._scenes[self.scene]
        self._moments[self.now_ns] = Moment(self._round, people)
        for topic, message in messages:
            if topic not in without:
                self._pubs[topic].publish(with_stamp(message, time_from(self.now_ns)))
        return self.now_ns

    def pass_time(self, elapsed_ns):
        """Move the clock; back, where that is negative."""
        self.now_ns += elapsed_ns
        self._round += elapsed_ns < 0
        self.tell(self.now_ns)

    def tell(self, time_ns):
        """Say that it is some time, once."""
        self._clock_pub.publish(Clock(time_from(time_ns)))

    def pause(self, seconds, speed=10.0):
        """Let time pass without images, faster than by the machine's clock."""
        for _tick in range(int(10 * seconds)):
            self.pass_time(NS // 10)
            time.sleep(0.1 / speed)

    def step(self):
        """Send the next image, and wait until its tracks come."""
        stamp = time_from(self.send())
        wait_until(lambda: _is_newest(stamp, self.tracks.messages), 'tracks of the image of %.3f' % stamp.to_sec())

    def tries(self, patience_s):
        """Send the next image, which a node may miss; whether its tracks come."""
        stamp = time_from(self.send())
        return _within(patience_s, lambda: _is_newest(stamp, self.tracks.messages))

    def recovered(self, fault, limit=RECOVERY_IMAGES):
        """Send images until all who are there are followed, and handed to planners; measure how many it takes.

        Until one is answered, an image may be missed; from then on each is waited for, however slow the machine is.
        """
        began_s, sent = time.monotonic(), set()
        for count in range(1, limit + 1):
            is_answered = self.tries(_patience_s(self.tracks.messages, sent))
            sent.add(self.now_ns)
            if is_answered and self._is_complete(sent):
                self.rows.append('%-66s %2d images (%.1f s of the stage), %.1f s by the machine' % (
                    fault, count, count * PERIOD_NS / NS, time.monotonic() - began_s))
                self.check()
                return self.ids()
        raise AssertionError('%s: not recovered after %d images; the last tracks: %s' % (
            fault, limit, self.tracks.messages[-1:]))

    def ids(self):
        """The numbers of the people, {name: id}."""
        message = self.tracks.messages[-1]
        people = self._moments[message.header.stamp.to_nsec()].people
        return {_name_of(track, people): track.id for track in message.objects}

    def _is_complete(self, sent):
        people = self._moments[self.now_ns].people
        tracks = self.tracks.messages[-1].objects
        if not (all(track.status == TrackedObject.VISIBLE for track in tracks)
                and sorted(_name_of(track, people) or '' for track in tracks) == sorted(people)):
            return False
        stamp = time_from(self.now_ns)
        return _within(_patience_s(self.points.messages, sent), lambda: any(
            message.header.stamp == stamp and message.width for message in self.points.messages[-5:]))

    def check(self):
        """Of the tracks that came: stamps are of images, in order; nobody is there who is not; numbers are of one."""
        messages = self.tracks.messages[self._checked:]
        self._checked += len(messages)
        for message in messages:
            stamp_ns = message.header.stamp.to_nsec()
            assert stamp_ns in self._moments, 'stamped %.3f, when no image was taken' % (stamp_ns / NS)
            now = (self._moments[stamp_ns].round, stamp_ns)
            assert now >= self._newest, 'stamped %.3f after %.3f' % (stamp_ns / NS, self._newest[1] / NS)
            self._newest, people = now, self._seen_lately(stamp_ns)
            for track in message.objects:
                name = _name_of(track, people)
                assert name, 'a ghost at %.3f: %s' % (stamp_ns / NS, track)
                assert self._names.setdefault(track.id, name) == name, 'number %d was %s and is %s' % (
                    track.id, self._names[track.id], name)

    def _seen_lately(self, stamp_ns):
        """Who was in an image of the last moments, {name: position}."""
        now, people = self._moments[stamp_ns].round, {}
        for other_ns in range(stamp_ns, stamp_ns - int(SHOWN_S * NS), -PERIOD_NS):
            moment = self._moments.get(other_ns)
            if moment is not None and moment.round == now:
                people.update(moment.people)
        return people


def _is_newest(stamp, messages):
    return bool(messages) and messages[-1].header.stamp == stamp


def _patience_s(messages, sent):
    """How long to wait for the next answer: not long before one of the images sent has any, as they may be missed."""
    return TIMEOUT_S if any(message.header.stamp.to_nsec() in sent for message in messages[-5:]) else IMPATIENCE_S


def _within(seconds, condition):
    """Whether a condition comes to hold within seconds of the machine's clock."""
    deadline_s = time.monotonic() + seconds
    while not condition():
        if time.monotonic() > deadline_s:
            return False
        time.sleep(0.002)
    return True


def _scene(number):
    """The messages of a picture without their stamps, and who is where."""
    simulator = Simulator(scenario_from({'rate': 10.0, 'people': SCENES[number]}))
    frame = simulator.frame(0)
    messages = [entry for entry in simulated_messages(simulator, frame, START_NS) if entry[0] in TOPICS]
    names = ('who stays', 'who is only in scene %d' % number)
    return messages, {name: person.position_m for name, person in zip(names, frame.people)}


def _name_of(track, people):
    """Who a track is, by position; None where it is nobody."""
    place = track.pose.pose.position
    near = [name for name, position_m in people.items()
            if np.hypot(place.x - position_m[0], place.y - position_m[1]) < NEAR_M]
    return near[0] if near else None
