"""Memory allocator settings of the process (glibc malloc)."""
import ctypes

M_TRIM_THRESHOLD, M_MMAP_THRESHOLD, M_ARENA_MAX = -1, -3, -8  # glibc's malloc.h
LARGEST_BYTES = 32 * 2 ** 20  # limit of glibc


def reuse_freed_memory():
    """Let glibc reuse the memory of freed images. Returns whether the settings were applied; not by other C libraries.

    By default, glibc returns large blocks to the system and requests them again, and the kernel clears them page by
    page. For a rospy node this is two thirds of the cost of receiving an image. All threads share one heap, so the
    retained memory does not exceed the peak use: rospy starts one thread per connection, and with one heap per thread
    (glibc's default) the memory of a node would grow with each subscriber that connects and disconnects.
    """
    try:
        mallopt = ctypes.CDLL(None).mallopt
    except (AttributeError, OSError):
        return False
    return all([mallopt(M_MMAP_THRESHOLD, LARGEST_BYTES) == 1, mallopt(M_TRIM_THRESHOLD, 4 * LARGEST_BYTES) == 1,
                mallopt(M_ARENA_MAX, 1) == 1])
