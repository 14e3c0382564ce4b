"""Whether the memory of images that are freed serves for the next ones."""
import os
import subprocess
import sys

PAGE_FAULTS = """
import resource, sys
from ros_3d_bb.memory import reuse_freed_memory
if sys.argv[1] == 'reuse':
    assert reuse_freed_memory()
def faults():
    return resource.getrusage(resource.RUSAGE_SELF).ru_minflt
for _ in range(5):
    bytes(bytearray(10 ** 6))
before = faults()
for _ in range(50):
    bytes(bytearray(10 ** 6))
print(faults() - before)
"""


def page_faults(how):
    path = os.pathsep.join(filter(None, sys.path))
    return int(subprocess.check_output([sys.executable, '-c', PAGE_FAULTS, how],
                                       env=dict(os.environ, PYTHONPATH=path)))


def test_blocks_as_large_as_images_cost_no_new_pages():
    assert page_faults('reuse') < min(100, page_faults('not'))
