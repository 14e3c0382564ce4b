"""How this process takes memory from the system and gives it back."""
import ctypes

M_TRIM_THRESHOLD, M_MMAP_THRESHOLD, M_ARENA_MAX = -1, -3, -8  # glibc's malloc.h
LARGEST_BYTES = 32 * 2 ** 20  # glibc takes no more


def reuse_freed_memory():
    """Let the C library use the memory of freed images for the next ones.

    By default it returns such large blocks to the system and asks for them anew, and the system clears them page by
    page: for a rospy node two thirds of what it costs to receive an image. What is kept is no more than what was in use
    at once, as all threads share one heap: rospy has one for each connection, and glibc would give each a heap of its
    own, so that a node keeps more with each subscriber that comes and goes. Does nothing where the C library is not
    glibc.

    Returns
    -------
    bool
        Whether that worked.
    """
    try:
        mallopt = ctypes.CDLL(None).mallopt
    except (AttributeError, OSError):
        return False
    return all([mallopt(M_MMAP_THRESHOLD, LARGEST_BYTES) == 1, mallopt(M_TRIM_THRESHOLD, 4 * LARGEST_BYTES) == 1,
                mallopt(M_ARENA_MAX, 1) == 1])
