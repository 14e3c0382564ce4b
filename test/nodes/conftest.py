"""The tests of nodes are a node themselves, on a master of their own. Each file needs a process of its own, therefore.

With `USE_SIM_TIME`, a file has simulated time.
"""
import pytest

from support.ros import own_master


@pytest.fixture(scope='session', autouse=True)
def ros_node(request):
    with own_master(getattr(request.session.items[0].module, 'USE_SIM_TIME', False)):
        yield
