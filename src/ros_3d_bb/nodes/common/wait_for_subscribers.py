"""Waiting for those who should not miss the beginning."""
import time

import rospy

POLL_S = 0.05
SETTLING_S = 1.0  # who has subscribed one topic still connects to the others
LONGEST_WAIT_S = 60.0  # those who have not come by then will not come


def wait_for_subscribers(publisher, wanted, meanwhile):
    """Wait until a publisher has `wanted` subscribers, calling `meanwhile` again and again.

    Raises
    ------
    RuntimeError
        If they do not come.
    """
    began_s = time.monotonic()
    while publisher.get_num_connections() < wanted and not rospy.is_shutdown():
        if time.monotonic() - began_s > LONGEST_WAIT_S:
            raise RuntimeError('%d subscribers of %s came within %.0f s; %d expected (~wait_for_subscribers)' % (
                publisher.get_num_connections(), publisher.resolved_name, LONGEST_WAIT_S, wanted))
        meanwhile()
        time.sleep(POLL_S)
    if wanted:
        time.sleep(SETTLING_S)
