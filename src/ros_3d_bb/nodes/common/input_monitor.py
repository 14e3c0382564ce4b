"""Detect external faults from the inputs of a node: silent topics, wrong stamps, a stopped clock."""
import time
import weakref

import rospy
from rospy.topics import get_topic_manager

from ros_3d_bb.diagnosis.observations import Stream
from ros_3d_bb.diagnosis.topic_faults import STANDSTILL, clock_fault, silence_fault
from ros_3d_bb.diagnosis.topic_roles import role_named
from ros_3d_bb.nodes.common.master import NO_ANSWER
from ros_3d_bb.nodes.common.subscribers import inputs
from ros_3d_bb.nodes.common.topic_publishers import published_topics, publishers_of

SILENT_S = 5.0
ASKED_S = 10.0  # between two requests to the master about one topic
NO_RESULTS = '/rosout', '/diagnostics', '/clock', '/tf', '/tf_static'


class InputWatch(object):
    """Check the inputs once per second. The only cost for their callbacks is to record each message."""

    def __init__(self):
        self._began_s, self._looked_s = time.monotonic(), time.monotonic()
        self._counts, self._silences = weakref.WeakKeyDictionary(), weakref.WeakKeyDictionary()
        self._vain_s, self._vain = -ASKED_S, None  # time and error of the last failed request to the master

    def values(self):
        """Yield (name, text) of each input: its topic and its rate since the last call."""
        now_s = time.monotonic()
        passed_s, self._looked_s = max(now_s - self._looked_s, 1e-3), now_s
        for noted in inputs():
            new = noted.count - self._counts.get(noted, 0)
            self._counts[noted] = noted.count
            yield 'input ' + noted.name, '%s %.1f Hz' % (noted.subscriber.resolved_name, new / passed_s)

    def faults(self):
        """Yield (event, sentence) for each current fault."""
        now_s = time.monotonic()
        if now_s - self._began_s > SILENT_S and not rospy.get_rostime():
            yield 'time stands still', '%s; %s' % STANDSTILL
            return
        for noted in inputs():
            if now_s - (noted.came_s or self._began_s) > SILENT_S:
                yield 'silence on ' + noted.name, self._silence(noted, now_s)
            elif noted.count:
                fault = clock_fault(_stream(noted), not rospy.rostime.is_wallclock())
                if fault[0]:
                    yield 'clocks', '%s; %s' % fault

    def _silence(self, noted, now_s):
        """Return why an input is silent. The master is queried at most every ASKED_S per topic."""
        asked_s, sentence = self._silences.get(noted, (-ASKED_S, ''))
        if now_s - asked_s < ASKED_S:
            return sentence
        if now_s - self._vain_s >= ASKED_S:
            try:
                self._silences[noted] = now_s, self._reason(noted, now_s)
                return self._silences[noted][1]
            except NO_ANSWER as error:
                self._vain_s, self._vain = time.monotonic(), error
        return 'nothing comes on %s, and the master does not answer (%s)' % (_stream(noted).topic, self._vain)

    def _reason(self, noted, now_s):
        """Return a sentence with the cause of the silence. Raises one of `NO_ANSWER`."""
        others = inputs()
        taken = set(other.subscriber.resolved_name for other in others if other.count) | set(get_topic_manager().pubs)
        topics = published_topics()
        connected = noted.subscriber.get_num_connections() > 0
        stream = _stream(noted)._replace(publishers=publishers_of(noted.subscriber.resolved_name, connected))
        stream = stream._replace(published_kind=topics.get(stream.topic, ''))
        return '%s; %s' % silence_fault(stream, topics, taken, now_s - (noted.came_s or self._began_s))


def unheard():
    """Return the result topics of this node if none of them has subscribers, otherwise an empty list."""
    tuning = rospy.get_name() + '/parameter_'
    results = [(topic, publisher) for topic, publisher in sorted(get_topic_manager().pubs.items())
               if topic not in NO_RESULTS and not topic.startswith(tuning)]
    return [] if any(publisher.has_connections() for _topic, publisher in results) else [
        topic for topic, _publisher in results]


def _stream(noted):
    lag_s, machine_lag_s = noted.lags_s
    return Stream(role_named(noted.name, noted.kind._type), noted.subscriber.resolved_name, count=noted.count,
                  lag_s=lag_s, machine_lag_s=machine_lag_s)
