"""Progress bar of commands that take minutes."""
import sys

WIDTH = 40


def with_progress(items, stream=None):
    """Yield the items of a sequence, and show on a terminal (stderr by default) how many are done."""
    stream = stream or sys.stderr
    for number, item in enumerate(items, 1):
        yield item
        if stream.isatty():
            stream.write('\r[%-*s] %3d %%' % (WIDTH, '#' * (WIDTH * number // len(items)), 100 * number // len(items)))
            stream.write('\n' if number == len(items) else '')
            stream.flush()
