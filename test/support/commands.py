"""Commands in this process."""
import contextlib
import io
import sys
from unittest import mock


def run(main, *arguments):
    """Exit status of a command with arguments, and what it prints."""
    printed, status, words = io.StringIO(), 0, ['command'] + [str(argument) for argument in arguments]
    with contextlib.redirect_stdout(printed), contextlib.redirect_stderr(printed), \
            mock.patch.object(sys, 'argv', words):
        try:
            main()
        except SystemExit as error:
            status = error.code
    return status, printed.getvalue()
