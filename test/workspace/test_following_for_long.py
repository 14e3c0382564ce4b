"""Ten minutes of following a person through crossings, with the nodes."""
import os
import subprocess

import pytest

from support.pages import ROOT


@pytest.mark.long
def test_the_robot_follows_one_person_for_ten_minutes():
    subprocess.check_call(['rostest', os.path.join(ROOT, 'test', 'nodes', 'follow_node.test')],
                          env=dict(os.environ, ROS_3D_BB_FOLLOW_S='600'))
