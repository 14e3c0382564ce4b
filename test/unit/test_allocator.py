"""Whether the memory of images that are freed serves for the next ones."""
import os
import subprocess
import sys

PAGE_FAULTS = """
import resource, sys, threading
from ros_3d_bb.nodes.common.allocator import reuse_freed_memory
if sys.argv[1] == 'reuse':
    assert reuse_freed_memory()
def faults():
    return resource.getrusage(resource.RUSAGE_SELF).ru_minflt
def take(times):
    for _ in range(times):
        bytes(bytearray(10 ** 6))
"""
IN_TURN = PAGE_FAULTS + """
take(5)
before = faults()
take(50)
print(faults() - before)
"""
IN_THREADS = PAGE_FAULTS + """
begin, end = [threading.Event() for _ in range(8)], [threading.Event() for _ in range(8)]
def run(number):
    begin[number].wait()
    take(5)
    end[number].set()
    begin[7].wait()  # all of them live until the last one has done
threads = [threading.Thread(target=run, args=(number,)) for number in range(8)]
for thread in threads:
    thread.start()
before = faults()
for number in range(8):
    begin[number].set()
    end[number].wait()
print(faults() - before)
"""


def page_faults(program, how):
    path = os.pathsep.join(filter(None, sys.path))
    return int(subprocess.check_output([sys.executable, '-c', program, how], env=dict(os.environ, PYTHONPATH=path)))


def test_blocks_as_large_as_images_cost_no_new_pages():
    assert page_faults(IN_TURN, 'reuse') < min(100, page_faults(IN_TURN, 'not'))


def test_what_one_thread_freed_serves_another():
    """rospy has a thread for each connection, and subscribers come and go."""
    assert page_faults(IN_THREADS, 'reuse') < min(1000, page_faults(IN_THREADS, 'not') / 2)
