"""Formatting of exceptions for log lines."""


def cause(error: BaseException) -> str:
    """Message of an exception as one short line without control characters, or its type if the message is empty."""
    return ascii(' '.join(str(error).split()))[1:-1][:300] or type(error).__name__
