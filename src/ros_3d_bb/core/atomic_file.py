"""Atomic writing of files, and their removal when a command is ended."""
import contextlib
import errno
import os
import signal
import sys
import tempfile
from typing import Iterator


def atomic_write(path: str, data: bytes) -> None:
    """Write the bytes `data` to `path` atomically: after an error or a crash the old content is intact."""
    with replacement_of(path) as temporary:
        with open(temporary, 'wb') as stream:
            stream.write(data)
            stream.flush()
            os.fsync(stream.fileno())


@contextlib.contextmanager
def replacement_of(path: str, prefix: str = '.', suffix: str = '.tmp') -> Iterator[str]:
    """Yield the name of an empty file in the folder of `path`, which replaces `path` when the block ends, or is removed
    if the block raises an exception. No other process has this name.

    Raises OSError before the block if `path` cannot be written.
    """
    temporary = _new_file_beside(path, prefix, suffix)
    try:
        yield temporary
        mask = os.umask(0)
        os.umask(mask)
        os.chmod(temporary, 0o666 & ~mask)  # mkstemp permits only the owner to read it
        os.replace(temporary, path)
    except BaseException:
        with contextlib.suppress(FileNotFoundError):
            os.unlink(temporary)
        raise


def check_writable(path: str) -> None:
    """Raise OSError if a file cannot be written to `path`. For commands that run long before they write."""
    os.unlink(_new_file_beside(path, '.', '.tmp'))


def _new_file_beside(path: str, prefix: str, suffix: str) -> str:
    if os.path.isdir(path):
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), path)
    try:
        descriptor, name = tempfile.mkstemp(dir=os.path.dirname(path), prefix=prefix, suffix=suffix)
    except OSError as error:
        raise type(error)(error.errno, error.strerror, path)
    os.close(descriptor)
    return name


def clean_up_on_sigterm() -> None:
    """Let SIGTERM, and SIGHUP unless nohup has disabled it, end this command by SystemExit, so that it cleans up."""
    for number in (signal.SIGTERM, signal.SIGHUP):
        if signal.getsignal(number) == signal.SIG_DFL:
            signal.signal(number, lambda given, _frame: sys.exit(128 + given))
