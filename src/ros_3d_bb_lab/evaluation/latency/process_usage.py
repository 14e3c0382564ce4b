"""What processes use, as /proc of Linux tells it."""
import os
from typing import NamedTuple

TICKS_A_SECOND = os.sysconf('SC_CLK_TCK')
KIB_A_MB = 1000.0 / 1.024  # megabytes are 10^6 bytes


class Usage(NamedTuple):
    """CPU time of all threads since a process began, seconds; memory that it holds now, megabytes."""

    cpu_s: float
    rss_mb: float


def usage_of(pid):
    """What a process uses.

    Returns
    -------
    Usage, or None where there is no such process.
    """
    try:
        with open('/proc/%d/stat' % pid) as stream:
            after_name = stream.read().rpartition(')')[2].split()  # the name may hold anything
        with open('/proc/%d/status' % pid) as stream:
            fields = dict(line.partition(':')[::2] for line in stream)
    except (FileNotFoundError, ProcessLookupError):
        return None
    ticks = int(after_name[11]) + int(after_name[12])  # utime, stime: proc(5)
    return Usage(ticks / float(TICKS_A_SECOND), int(fields.get('VmRSS', '0 kB').split()[0]) / KIB_A_MB)
