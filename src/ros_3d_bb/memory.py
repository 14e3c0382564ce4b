"""How this process takes memory from the system and gives it back."""
import ctypes

M_TRIM_THRESHOLD, M_MMAP_THRESHOLD = -1, -3  # glibc's malloc.h
LARGEST_BYTES = 32 * 2 ** 20  # glibc takes no more


def reuse_freed_memory():
    """Let the C library use the memory of freed images for the next ones.

    By default it returns such large blocks to the system and asks for them anew, and the system clears them page by
    page: for a rospy node two thirds of what it costs to receive an image. What is kept is no more than what was in use
    at once. Does nothing where the C library is not glibc.

    Returns
    -------
    bool
        Whether that worked.
    """
    try:
        mallopt = ctypes.CDLL(None).mallopt
    except (AttributeError, OSError):
        return False
    return mallopt(M_MMAP_THRESHOLD, LARGEST_BYTES) == 1 and mallopt(M_TRIM_THRESHOLD, 4 * LARGEST_BYTES) == 1
