"""The faults of test_faults.py in random order, again and again (`./run soak`): no process ends, and memory is flat.

The nodes are not killed, so that each process lives as long as the soak.
"""
import random
import time

import numpy as np
import rospy

import test_faults as faults
from ros_3d_bb.conversions.camera_msgs import COLOR_TOPIC, DEPTH_TOPIC, INFO_TOPICS
from ros_3d_bb_lab.evaluation.latency.latency_probe_node import pid_of, usage_of
from test_faults import pipeline_stage, stage  # noqa: F401 (fixtures)

FAULTS = ([(faults.test_a_node_hangs_and_continues, node) for node in faults.NODES]
          + [(faults.test_the_camera_pauses_for_10_s,), (faults.test_transforms_stop, 1, 0.1, 0),
             (faults.test_transforms_stop, 10, 0.03, 1), (faults.test_the_processor_is_busy,),
             (faults.test_subscribers_that_never_read_do_not_block_the_others,)]
          + [(faults.test_time_jumps, seconds) for seconds in (-0.75, -30.05, -3600, 3600)]
          + [(faults.test_the_clock_is_wrong_once, seconds) for seconds in (-3600, 3600)]
          + [(faults.test_images_stop_on_one_topic, topic) for topic in (DEPTH_TOPIC, COLOR_TOPIC, INFO_TOPICS[0])])
RISE_MB = 100.0  # limit of the rise after the first round: queues of images that a hanging process has not read


def test_no_process_ends_and_memory_is_flat(stage):  # noqa: F811
    source, end_s = random.Random(rospy.get_param('~seed')), time.monotonic() + 60 * rospy.get_param('~minutes')
    pids, rounds_mb = [pid_of(node) for node in faults.NODES], []
    while time.monotonic() < end_s or len(rounds_mb) < 2:
        for fault, *values in source.sample(FAULTS, len(FAULTS)):
            faults.track_the_first_scene(stage)
            fault(stage, *values)
            assert [pid_of(node) for node in faults.NODES] == pids, fault
        rounds_mb.append([usage_of(pid)[1] for pid in pids])
        print('%d faults; memory of %s: %s MB' % (len(rounds_mb) * len(FAULTS), ', '.join(faults.NODES),
                                                  np.rint(rounds_mb[-1]).astype(int).tolist()))
    assert (np.max(rounds_mb, axis=0) - rounds_mb[0]).max() < RISE_MB
