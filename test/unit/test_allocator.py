"""Freed memory of images is reused for the next ones."""
import os
import subprocess
import sys

import pytest

PROGRAM = """
import resource, sys, threading
from ros_3d_bb.nodes.common.startup import reuse_freed_memory
how, threads = sys.argv[1], int(sys.argv[2])
if how == 'reuse':
    assert reuse_freed_memory()
done, end = threading.Semaphore(0), threading.Event()
def allocate(times=5):
    for _ in range(times):
        bytes(bytearray(10 ** 6))
def run():
    allocate()
    done.release()
    end.wait()  # all threads live until the last one is done
if not threads:
    allocate()
before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
if not threads:
    allocate(50)
for _ in range(threads):
    threading.Thread(target=run).start()
    done.acquire()
print(resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before)
end.set()
"""


@pytest.mark.parametrize('threads, most', [(0, 100), (8, 1000)])
def test_blocks_as_large_as_images_cost_few_new_pages(threads, most):
    """Also in other threads: rospy has one for each connection, and subscribers come and go."""
    def page_faults(how):
        path = os.pathsep.join(filter(None, sys.path))
        return int(subprocess.check_output([sys.executable, '-c', PROGRAM, how, str(threads)],
                                           env=dict(os.environ, PYTHONPATH=path)))
    assert page_faults('reuse') < min(most, page_faults('default') / 2)
