"""Wait for the subscribers that must receive the first message."""
import time

import rospy

POLL_S = 0.05
SETTLING_S = 1.0  # a node that has connected to one topic may still be connecting to the others
LONGEST_WAIT_S = 60.0  # after this time, missing subscribers are an error


def wait_for_subscribers(publisher, wanted, meanwhile):
    """Wait until a publisher has `wanted` subscribers, and call `meanwhile` repeatedly.

    Raises
    ------
    RuntimeError
        If there are fewer subscribers after LONGEST_WAIT_S.
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
