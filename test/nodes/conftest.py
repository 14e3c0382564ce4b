"""The tests of nodes are a node themselves, on the master of rostest, which gives it its name."""
import pytest
import rospy


@pytest.fixture(scope='session', autouse=True)
def ros_node():
    rospy.init_node('test')
