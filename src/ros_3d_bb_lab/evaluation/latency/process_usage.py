"""Resource usage of processes, read from /proc on Linux."""
import os
from typing import NamedTuple

TICKS_A_SECOND = os.sysconf('SC_CLK_TCK')
KIB_A_MB = 1000.0 / 1.024  # 1 MB is 10^6 bytes


class Usage(NamedTuple):
    """CPU time of all threads since the start of a process in seconds, and its current resident memory in megabytes."""

    cpu_s: float
    rss_mb: float


def usage_of(pid):
    """Read the resource usage of a process.

    Returns
    -------
    Usage or None
        None if the process does not exist.
    """
    try:
        with open('/proc/%d/stat' % pid) as stream:
            after_name = stream.read().rpartition(')')[2].split()  # the name may contain any character
        with open('/proc/%d/status' % pid) as stream:
            fields = dict(line.partition(':')[::2] for line in stream)
    except (FileNotFoundError, ProcessLookupError):
        return None
    ticks = int(after_name[11]) + int(after_name[12])  # utime, stime: proc(5)
    return Usage(ticks / float(TICKS_A_SECOND), int(fields.get('VmRSS', '0 kB').split()[0]) / KIB_A_MB)
